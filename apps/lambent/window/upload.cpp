#include "upload.h"

#include <lambent/core/clock.h>

// clang-format off
#include <GLFW/glfw3.h>
#include <GL/glext.h>
// clang-format on

namespace lambent::tool {
namespace {

double ms_since(Clock::time_point start) { return 1e3 * seconds_since(start); }

// What OpenGL 3.3's header need not declare, of the current context.
struct Functions {
  PFNGLGENBUFFERSPROC gen_buffers;
  PFNGLDELETEBUFFERSPROC delete_buffers;
  PFNGLBINDBUFFERPROC bind_buffer;
  PFNGLBUFFERSTORAGEPROC buffer_storage;
  PFNGLMAPBUFFERRANGEPROC map_buffer_range;
  PFNGLFENCESYNCPROC fence_sync;
  PFNGLCLIENTWAITSYNCPROC client_wait_sync;
  PFNGLDELETESYNCPROC delete_sync;
};
Functions gl;

bool find_functions() {
  bool all = true;
  const auto find = [&](auto& function, const char* name) {
    function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(glfwGetProcAddress(name));
    all &= function != nullptr;
  };
  find(gl.gen_buffers, "glGenBuffers"), find(gl.delete_buffers, "glDeleteBuffers");
  find(gl.bind_buffer, "glBindBuffer"), find(gl.buffer_storage, "glBufferStorage");
  find(gl.map_buffer_range, "glMapBufferRange"), find(gl.fence_sync, "glFenceSync");
  find(gl.client_wait_sync, "glClientWaitSync"), find(gl.delete_sync, "glDeleteSync");
  return all && glfwExtensionSupported("GL_ARB_buffer_storage");
}

}  // namespace

void PictureUpload::open() {
  mapped_ = find_functions();
  glGenTextures(1, &texture_);
  glBindTexture(GL_TEXTURE_2D, texture_);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
}

void PictureUpload::close() {
  drop_buffers();
  if (texture_) glDeleteTextures(1, &texture_);
  *this = {};
}

// Deleting a buffer unmaps it; OpenGL keeps what it still reads.
void PictureUpload::drop_buffers() {
  for (Buffer& b : ring_) {
    if (b.fence) gl.delete_sync(static_cast<GLsync>(b.fence));
    if (b.name) gl.delete_buffers(1, &b.name);
    b = {};
  }
  bytes_ = 0;
}

bool PictureUpload::make_buffers(size_t bytes) {
  drop_buffers();
  constexpr GLbitfield how = GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
  bool made = true;
  for (Buffer& b : ring_) {
    gl.gen_buffers(1, &b.name);
    gl.bind_buffer(GL_PIXEL_UNPACK_BUFFER, b.name);
    gl.buffer_storage(GL_PIXEL_UNPACK_BUFFER, GLsizeiptr(bytes), nullptr, how);
    b.memory = static_cast<uint8_t*>(gl.map_buffer_range(GL_PIXEL_UNPACK_BUFFER, 0, GLsizeiptr(bytes), how));
    made &= b.memory != nullptr;
  }
  gl.bind_buffer(GL_PIXEL_UNPACK_BUFFER, 0);
  if (made) bytes_ = bytes;
  else drop_buffers();
  return made;
}

void PictureUpload::wait_for(Buffer& b) {
  if (!b.fence) return;
  const GLsync fence = static_cast<GLsync>(b.fence);
  gl.client_wait_sync(fence, GL_SYNC_FLUSH_COMMANDS_BIT, 1000000000);  // nanoseconds: a context that is lost answers
  gl.delete_sync(fence), b.fence = nullptr;
}

uint8_t* PictureUpload::begin(int width, int height) {
  const auto start = Clock::now();
  width_ = width, height_ = height;
  const size_t bytes = 4 * size_t(width) * size_t(height);
  if (mapped_ && bytes > bytes_) mapped_ = make_buffers(bytes);
  if (!mapped_) plain_.resize(bytes);
  else wait_for(ring_[turn_]);
  waited_ = ms_since(start);
  return mapped_ ? ring_[turn_].memory : plain_.data();
}

void PictureUpload::end() {
  const auto start = Clock::now();
  glBindTexture(GL_TEXTURE_2D, texture_);
  if (texture_width_ != width_ || texture_height_ != height_)
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, width_, height_, 0, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
  texture_width_ = width_, texture_height_ = height_;
  if (mapped_) gl.bind_buffer(GL_PIXEL_UNPACK_BUFFER, ring_[turn_].name);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width_, height_, GL_RGBA, GL_UNSIGNED_BYTE,
                  mapped_ ? nullptr : plain_.data());
  if (mapped_) {
    gl.bind_buffer(GL_PIXEL_UNPACK_BUFFER, 0);
    ring_[turn_].fence = gl.fence_sync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    turn_ = (turn_ + 1) % buffers;
  }
  milliseconds_ = waited_ + ms_since(start);
}

}  // namespace lambent::tool
