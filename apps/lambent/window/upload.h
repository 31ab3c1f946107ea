#pragma once
// The picture's way to the screen: written straight into memory that OpenGL reads, where it can be mapped for good
// (GL_ARB_buffer_storage, a ring of buffers with a fence each), and else into memory that is copied. The same bytes
// both ways.
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lambent::tool {

// Of the context that is current.
class PictureUpload {
 public:
  void open();   // makes the texture, and finds out what the context has
  void close();  // before the context goes
  unsigned texture() const { return texture_; }
  // Where the next picture is to be written, RGBA, rows from the top; not to be read from.
  uint8_t* begin(int width, int height);
  // It is written: to the texture. How long that took beside the writing is in milliseconds().
  void end();
  bool is_mapped() const { return mapped_; }
  double milliseconds() const { return milliseconds_; }

 private:
  static constexpr size_t buffers = 3;  // one is written, one goes to the texture, one is at hand
  struct Buffer {
    unsigned name = 0;
    uint8_t* memory = nullptr;
    void* fence = nullptr;  // until which OpenGL reads it
  };
  bool make_buffers(size_t bytes);
  void drop_buffers();
  void wait_for(Buffer& buffer);

  unsigned texture_ = 0;
  Buffer ring_[buffers] = {};
  size_t turn_ = 0, bytes_ = 0;  // of each buffer
  std::vector<uint8_t> plain_ = {};
  int width_ = 0, height_ = 0;  // of the picture under way
  int texture_width_ = 0, texture_height_ = 0;
  bool mapped_ = false;
  double milliseconds_ = 0, waited_ = 0;
};

}  // namespace lambent::tool
