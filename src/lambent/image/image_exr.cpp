// OpenEXR, through its C++ library. Luminance and chroma: "Technical Introduction to OpenEXR".
#include <lambent/image/exr_header.h>
#include <lambent/image/picture_name.h>

#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfChromaticitiesAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#include <ImfRgbaFile.h>
#include <ImfRgbaYca.h>
#include <ImfStandardAttributes.h>

#include <cstring>
#include <exception>
#include <new>

namespace lambent {
namespace {

constexpr float half_max = 65504;

// --- Streams over memory

class MemoryInput : public Imf::IStream {
 public:
  // `one_part` clears the bit of the version that says that there are several.
  MemoryInput(std::span<const uint8_t> bytes, const std::string& name, bool one_part)
      : IStream(name.c_str()), bytes_(bytes), one_part_(one_part) {}
  bool read(char out[], int count) override {
    if (count < 0 || at_ > bytes_.size() || uint64_t(count) > bytes_.size() - at_)
      throw std::runtime_error("truncated");
    std::memcpy(out, bytes_.data() + at_, size_t(count));
    constexpr uint64_t place = 5;
    if (one_part_ && at_ <= place && at_ + uint64_t(count) > place) out[place - at_] &= char(~0x10);
    at_ += uint64_t(count);
    return at_ < bytes_.size();
  }
  uint64_t tellg() override { return at_; }
  void seekg(uint64_t position) override { at_ = position; }

 private:
  std::span<const uint8_t> bytes_;
  bool one_part_;
  uint64_t at_ = 0;
};

class MemoryOutput : public Imf::OStream {
 public:
  explicit MemoryOutput(const std::string& name) : OStream(name.c_str()) {}
  void write(const char data[], int count) override {
    if (at_ + uint64_t(count) > bytes.size()) bytes.resize(size_t(at_) + size_t(count));
    std::memcpy(bytes.data() + at_, data, size_t(count));
    at_ += uint64_t(count);
  }
  uint64_t tellp() override { return at_; }
  void seekp(uint64_t position) override { at_ = position; }
  std::vector<uint8_t> bytes;

 private:
  uint64_t at_ = 0;
};

// One line, whatever names the file has.
void make_one_line(std::string& text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
}

// The library's messages hold the file's name and may hold line ends.
std::string one_line(std::string text, const std::string& path) {
  if (size_t at = text.find("\"" + path + "\". "); at != std::string::npos) text.erase(0, at + path.size() + 4);
  make_one_line(text);
  while (!text.empty() && (text.back() == '.' || text.back() == ' ')) text.pop_back();
  return text.empty() ? "unreadable" : text;
}

// --- Pixels

constexpr Vec2 as_vec(Imath::V2f v) { return {v.x, v.y}; }

// The file's primaries, or Rec. 709's.
Imf::Chromaticities chromaticities_of(const Imf::Header& header) {
  return Imf::hasChromaticities(header) ? Imf::chromaticities(header) : Imf::Chromaticities();
}

// Y, RY = (R - Y) / Y and BY = (B - Y) / Y of every pixel, as read into R, G and B; `weights` make Y of RGB.
void rgb_from_chroma(std::vector<Vec3>& pixels, Imath::V3f weights) {
  for (Vec3& p : pixels) {
    const float y = p.y, red = (p.x + 1) * y, blue = (p.z + 1) * y;
    p = {red, (y - red * weights.x - blue * weights.z) / weights.y, blue};
  }
}

// Chroma at every second pixel of every second row is interpolated by the library, which does it in half floats.
void read_coarse_chroma(MemoryInput& stream, const ExrLayer& layer, Image& image) {
  Imf::RgbaInputFile file(stream, layer.name, 0);
  const Imath::Box2i window = file.dataWindow();
  std::vector<Imf::Rgba> pixels(image.rgb.size());
  // Where pixel (0, 0) would lie, as the library wants it: maybe outside.
  const int64_t first = int64_t(window.min.x) + int64_t(window.min.y) * image.width;
  const uintptr_t origin = reinterpret_cast<uintptr_t>(pixels.data()) - uintptr_t(first) * sizeof(Imf::Rgba);
  file.setFrameBuffer(reinterpret_cast<Imf::Rgba*>(origin), 1, size_t(image.width));
  file.readPixels(window.min.y, window.max.y);
  for (size_t i = 0; i < pixels.size(); ++i) {
    image.rgb[i] = {pixels[i].r, pixels[i].g, pixels[i].b};
    if (!layer.alpha.empty()) image.alpha[i] = pixels[i].a;
  }
}

Result<Image> read_pixels(std::span<const uint8_t> bytes, const ExrHeader& header, const ExrLayer& layer, bool coarse,
                          const std::string& path) {
  const ExrPart& part = header.parts[layer.part];
  MemoryInput stream(bytes, path, header.flagged);
  Imf::MultiPartInputFile file(stream, 0);
  if (file.parts() != int(header.parts.size())) return Error{path, "header has parts of two kinds"};
  const Imf::Header& found = file.header(int(layer.part));
  if (!file.partComplete(int(layer.part))) return Error{path, "truncated: rows or tiles are missing"};
  const Imath::Box2i& window = found.dataWindow();
  if (window.min.x != part.x0 || window.min.y != part.y0 || window.max.x != part.x0 + part.width - 1 ||
      window.max.y != part.y0 + part.height - 1)
    return Error{path, "header has two data windows"};
  const bool colored = layer.has_color() || !layer.ry.empty();
  const Imf::Chromaticities c = chromaticities_of(found);
  auto matrix = rec709_from_primaries(as_vec(c.red), as_vec(c.green), as_vec(c.blue), as_vec(c.white));
  if (colored && !matrix) return Error{path, matrix.error().message};

  Image image(int(part.width), int(part.height));
  if (!layer.alpha.empty()) image.alpha.resize(image.rgb.size());
  if (coarse) {
    MemoryInput again(bytes, path, header.flagged);
    read_coarse_chroma(again, layer, image);
  } else {
    Imf::FrameBuffer pixels;
    auto add = [&](const std::string& name, float* base, size_t step) {
      if (!name.empty())
        pixels.insert(name, Imf::Slice::Make(Imf::FLOAT, base, window, step, step * size_t(part.width)));
    };
    const bool chroma = !layer.ry.empty();
    const std::string names[] = {chroma              ? layer.ry
                                 : layer.has_color() ? layer.red
                                                     : layer.y,
                                 chroma ? layer.y : layer.green, chroma ? layer.by : layer.blue};
    for (int k = 0; k < 3; ++k) add(names[k], &image.rgb[0][k], sizeof(Vec3));
    add(layer.alpha, image.alpha.data(), sizeof(float));
    Imf::InputPart input(file, int(layer.part));
    input.setFrameBuffer(pixels);
    input.readPixels(window.min.y, window.max.y);
    if (chroma) rgb_from_chroma(image.rgb, Imf::RgbaYca::computeYw(c));
  }
  if (!colored)
    for (Vec3& v : image.rgb) v = Vec3(v.x);
  for (float& a : image.alpha) a = std::fmin(std::fmax(a, 0.0f), 1.0f);
  if (colored) convert_color(image.rgb, *matrix);
  return image;
}

// Whether the chroma is coarse: at every second pixel of every second row. Errors: samples that are no such picture's.
Result<bool> sampling_of(const ExrHeader& header, const ExrLayer& layer, const std::string& path) {
  const ExrPart& part = header.parts[layer.part];
  const auto steps = [&](const std::string& name, int step) {
    const ExrChannel* c = name.empty() ? nullptr : part.find(name);
    return !c || (c->x_step == step && c->y_step == step);
  };
  if (layer.ry.empty() != layer.by.empty())
    return Error{path, "has one channel of chroma, RY or BY, and not the other"};
  for (const std::string& name : {layer.red, layer.green, layer.blue, layer.alpha, layer.y})
    if (!steps(name, 1)) return Error{path, "channel " + name + " is subsampled"};
  if (layer.ry.empty() || (steps(layer.ry, 1) && steps(layer.by, 1))) return false;
  if (!steps(layer.ry, 2) || !steps(layer.by, 2) || layer.part > 0)
    return Error{path, "chroma is neither as fine as luminance nor, in the first part, half as fine"};
  return true;
}

Result<ImageFile> load_any(std::span<const uint8_t> bytes, const std::string& path) {
  if (image_format(bytes) != ImageFormat::exr) return Error{path, "not an OpenEXR file"};
  auto header = read_exr_header(bytes, path);
  if (!header) return header.error();
  ImageFile file{.format = ImageFormat::exr};
  auto layer = choose_exr_layer(*header, picture_name(path).layer, path, file.warnings);
  if (!layer) return layer.error();
  auto coarse = sampling_of(*header, *layer, path);
  if (!coarse) return coarse.error();
  const ExrPart& part = header->parts[layer->part];
  if (auto ok = check_image_size(uint64_t(part.shown_width), uint64_t(part.shown_height), bytes.size(), path); !ok)
    return ok.error();
  if (header->flagged) file.warnings.push_back(path + ": says that it has several parts, and has one");
  file.left = int(part.x0 - part.shown_x0), file.top = int(part.y0 - part.shown_y0);
  file.width = int(part.shown_width), file.height = int(part.shown_height), file.envmap = part.envmap;
  // Of a map by its envmap attribute the data window may be what counts.
  const bool beyond = file.left < 0 || file.top < 0 || part.x0 + part.width > part.shown_x0 + part.shown_width ||
                      part.y0 + part.height > part.shown_y0 + part.shown_height;
  if (beyond && part.envmap == Envmap::unsaid)
    file.warnings.push_back(path + ": pixels outside its display window are left aside");
  bool halves = true;
  for (const std::string& name : {layer->red, layer->green, layer->blue, layer->y})
    if (const ExrChannel* c = name.empty() ? nullptr : part.find(name)) halves &= c->type == Imf::HALF;
  if (halves || *coarse) file.largest = half_max;
  try {
    auto image = read_pixels(bytes, *header, *layer, *coarse, path);
    if (!image) return image.error();
    file.image = std::move(*image);
    return file;
  } catch (const std::bad_alloc&) {
    return Error{path, "out of memory"};
  } catch (const std::exception& e) {
    return Error{path, "bad OpenEXR file: " + one_line(e.what(), path)};
  }
}

}  // namespace

Result<ImageFile> load_exr(std::span<const uint8_t> bytes, const std::string& path) {
  auto file = load_any(bytes, path);
  if (!file) {
    Error error = file.error();
    make_one_line(error.message);
    return error;
  }
  for (std::string& warning : file->warnings) make_one_line(warning);
  return file;
}

namespace {

// Interleaved pixels of one channel type, `bytes` a value, as a ZIP-compressed file.
std::vector<uint8_t> encode_pixels(const Image& image, const std::string& path, Imf::PixelType type, const void* pixels,
                                   size_t bytes) {
  const size_t channels = image.alpha.empty() ? 3 : 4, step = bytes * channels;
  Imf::Header header(image.width, image.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::FrameBuffer slices;
  const char* names[] = {"R", "G", "B", "A"};
  for (size_t c = 0; c < channels; ++c) {
    header.channels().insert(names[c], Imf::Channel(type));
    char* first = const_cast<char*>(static_cast<const char*>(pixels)) + c * bytes;  // only read by an OutputFile
    slices.insert(names[c], Imf::Slice(type, first, step, step * size_t(image.width)));
  }
  MemoryOutput stream(path);
  {
    Imf::OutputFile file(stream, header, 0);
    file.setFrameBuffer(slices);
    file.writePixels(image.height);
  }
  return std::move(stream.bytes);
}

}  // namespace

Result<std::vector<uint8_t>> encode_exr(const Image& image, const std::string& path, ExrPrecision precision) {
  auto to_half = [](float v) { return half(std::isfinite(v) ? std::fmin(std::fmax(v, -half_max), half_max) : v); };
  auto interleave = [&](auto convert) {
    std::vector<decltype(convert(0.0f))> pixels;
    pixels.reserve(image.rgb.size() * 4);
    for (size_t i = 0; i < image.rgb.size(); ++i) {
      for (int c = 0; c < 3; ++c) pixels.push_back(convert(image.rgb[i][c]));
      if (!image.alpha.empty()) pixels.push_back(convert(image.alpha[i]));
    }
    return pixels;
  };
  try {
    if (precision == ExrPrecision::half)
      return encode_pixels(image, path, Imf::HALF, interleave(to_half).data(), sizeof(half));
    return encode_pixels(image, path, Imf::FLOAT, interleave([](float v) { return v; }).data(), sizeof(float));
  } catch (const std::exception& e) {
    return Error{path, "OpenEXR could not be encoded: " + one_line(e.what(), path)};
  }
}

}  // namespace lambent
