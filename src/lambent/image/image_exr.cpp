// OpenEXR, through its C++ library. Header layout: "OpenEXR File Layout" of the project's documentation. Bradford
// adaptation: Lam 1985; matrices from primaries: SMPTE RP 177.
#include <lambent/image/image.h>

#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfChromaticitiesAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStandardAttributes.h>

#include <cstring>
#include <exception>
#include <new>
#include <string_view>

namespace lambent {
namespace {

// --- A first look at the header, in which every size is checked, so that the library never allocates for one that
// lies.

struct ExrHeader {
  int64_t x0 = 0, y0 = 0, width = 0, height = 0;  // data window
  bool has_window = false, tiled = false;
  uint64_t tile_width = 0, tile_height = 0;
  struct Channel {
    std::string name;
    bool full = true;  // one sample a pixel
  };
  std::vector<Channel> channels;
  uint64_t bytes_a_pixel = 0;

  const Channel* find(std::string_view name) const {
    for (const Channel& c : channels)
      if (c.name == name) return &c;
    return nullptr;
  }
};

struct ByteReader {
  std::span<const uint8_t> bytes;
  size_t at = 0;

  size_t left() const { return bytes.size() - at; }
  bool u32(uint32_t& value) {  // little-endian
    if (left() < 4) return false;
    const uint8_t* p = bytes.data() + at;
    value = uint32_t(p[0]) | uint32_t(p[1]) << 8 | uint32_t(p[2]) << 16 | uint32_t(p[3]) << 24;
    at += 4;
    return true;
  }
  bool text(std::string& value) {  // null-terminated, at most 255 characters
    const void* end = left() ? std::memchr(bytes.data() + at, 0, std::min<size_t>(left(), 256)) : nullptr;
    if (!end) return false;
    value.assign(reinterpret_cast<const char*>(bytes.data()) + at,
                 size_t(static_cast<const uint8_t*>(end) - bytes.data()) - at);
    at += value.size() + 1;
    return true;
  }
};

bool read_channels(std::span<const uint8_t> bytes, ExrHeader& header) {
  ByteReader in{bytes};
  for (;;) {
    ExrHeader::Channel channel;
    if (!in.text(channel.name)) return false;
    if (channel.name.empty()) return in.left() == 0;
    uint32_t type, linear, x_step, y_step;
    if (!in.u32(type) || !in.u32(linear) || !in.u32(x_step) || !in.u32(y_step) || type > 2) return false;
    // The library divides by the steps, as signed numbers.
    if (x_step == 0 || y_step == 0 || x_step > 0x7fffffff || y_step > 0x7fffffff) return false;
    channel.full = x_step == 1 && y_step == 1;
    header.bytes_a_pixel += type == 1 ? 2 : 4;
    header.channels.push_back(std::move(channel));
  }
}

bool read_window(std::span<const uint8_t> bytes, int64_t window[4]) {
  ByteReader in{bytes};
  for (int i = 0; i < 4; ++i) {
    uint32_t value;
    if (!in.u32(value)) return false;
    window[i] = int32_t(value);
  }
  return in.left() == 0;
}

Result<ExrHeader> read_header(std::span<const uint8_t> bytes, const std::string& path) {
  const Error truncated{path, "truncated header"};
  ByteReader in{bytes, 4};
  uint32_t version;
  if (bytes.size() < 4 || !in.u32(version)) return truncated;
  if ((version & 0xff) != 2) return Error{path, "OpenEXR version is not 2"};
  if (version & 0x800) return Error{path, "deep pixels are not read"};
  if (version & 0x1000) return Error{path, "files of several parts are not read"};
  if (version & ~uint32_t{0x6ff}) return Error{path, "unknown OpenEXR features"};

  ExrHeader header;
  header.tiled = version & 0x200;
  bool has_tiles = false;
  for (;;) {
    std::string name, type;
    uint32_t size;
    if (!in.text(name)) return truncated;
    if (name.empty()) break;
    if (!in.text(type) || !in.u32(size) || size > in.left()) return truncated;
    auto value = bytes.subspan(in.at, size);
    in.at += size;
    Error bad{path, "bad attribute \"" + name + "\" in the header"};
    if (name == "channels") {
      header.channels.clear(), header.bytes_a_pixel = 0;
      if (type != "chlist" || !read_channels(value, header)) return bad;
    } else if (name == "dataWindow" || name == "displayWindow") {
      int64_t w[4];
      constexpr int64_t reach = int64_t{1} << 29;  // keeps the library's int arithmetic from overflowing
      if (type != "box2i" || !read_window(value, w)) return bad;
      for (int64_t edge : w)
        if (edge < -reach || edge > reach) return bad;
      if (w[2] < w[0] || w[3] < w[1]) return bad;
      if (name == "dataWindow")
        header.x0 = w[0], header.y0 = w[1], header.width = w[2] - w[0] + 1, header.height = w[3] - w[1] + 1,
        header.has_window = true;
    } else if (name == "tiles") {
      ByteReader tile{value};
      uint32_t w, h;
      if (type != "tiledesc" || value.size() != 9 || !tile.u32(w) || !tile.u32(h) || w == 0 || h == 0) return bad;
      header.tile_width = w, header.tile_height = h, has_tiles = true;
    } else if (type == "preview") {
      ByteReader preview{value};
      uint32_t w, h;
      if (!preview.u32(w) || !preview.u32(h) || preview.left() != uint64_t(w) * h * 4) return bad;
    } else if (name == "type") {
      std::string_view kind(reinterpret_cast<const char*>(value.data()), value.size());
      if (kind.find("deep") != kind.npos) return Error{path, "deep pixels are not read"};
      // The library lets this attribute overrule the version's flags, which were relied on above.
      if (kind != (header.tiled ? "tiledimage" : "scanlineimage")) return bad;
    } else if (type == "idmanifest") {
      return bad;  // belongs to deep images, and states a size of its own that would be allocated
    }
  }
  if (!header.has_window) return Error{path, "header has no data window"};
  if (header.channels.empty()) return Error{path, "header has no channels"};
  if (header.tiled != has_tiles) return Error{path, "header does not say clearly whether the image is tiled"};

  if (auto ok = check_image_size(uint64_t(header.width), uint64_t(header.height), bytes.size(), path); !ok)
    return ok.error();
  // The library holds whole blocks of rows of all channels, or tiles, in memory.
  constexpr uint64_t free_bytes = uint64_t{1} << 26, bytes_a_byte = 65536;
  uint64_t pixels = uint64_t(header.width) * uint64_t(header.height);
  if (pixels * header.bytes_a_pixel / bytes_a_byte > free_bytes / bytes_a_byte + bytes.size())
    return Error{path, "channels do not fit the file's few bytes"};
  if (header.tiled) {
    constexpr uint64_t free_tile = uint64_t{1} << 20;
    if (header.tile_width > std::max(free_tile, pixels) / header.tile_height)
      return Error{path, "tiles are larger than the image"};
    uint64_t tiles = ((uint64_t(header.width) - 1) / header.tile_width + 1) *
                     ((uint64_t(header.height) - 1) / header.tile_height + 1);
    if (tiles > in.left() / 8) return Error{path, "truncated: fewer bytes than the table of tiles needs"};
  } else if (uint64_t(header.height) / 256 > in.left() / 8) {  // no compression packs more than 256 rows
    return Error{path, "truncated: fewer bytes than the table of rows needs"};
  }
  return header;
}

// --- Streams over memory

class MemoryInput : public Imf::IStream {
 public:
  MemoryInput(std::span<const uint8_t> bytes, const std::string& name) : IStream(name.c_str()), bytes_(bytes) {}
  bool read(char out[], int count) override {
    if (count < 0 || at_ > bytes_.size() || uint64_t(count) > bytes_.size() - at_)
      throw std::runtime_error("truncated");
    std::memcpy(out, bytes_.data() + at_, size_t(count));
    at_ += uint64_t(count);
    return at_ < bytes_.size();
  }
  uint64_t tellg() override { return at_; }
  void seekg(uint64_t position) override { at_ = position; }

 private:
  std::span<const uint8_t> bytes_;
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

// One line: the library's messages hold the file's name and may hold line ends.
std::string one_line(std::string text, const std::string& path) {
  if (size_t at = text.find("\"" + path + "\". "); at != std::string::npos) text.erase(0, at + path.size() + 4);
  for (char& c : text)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  while (!text.empty() && (text.back() == '.' || text.back() == ' ')) text.pop_back();
  return text.empty() ? "unreadable" : text;
}

// --- Colour

// RGB -> XYZ with the white's Y = 1.
Result<Mat3d> xyz_from_rgb(Vec2 red, Vec2 green, Vec2 blue, Vec2 white) {
  auto xyz = [](Vec2 c) { return Vec3d(c.x, c.y, 1.0 - double(c.x) - double(c.y)); };
  Mat3d primaries(xyz(red), xyz(green), xyz(blue));
  double determinant = lambent::determinant(primaries);
  if (!(std::abs(determinant) > 1e-6) || !(std::abs(white.y) > 1e-6f) || !std::isfinite(determinant))
    return Error{"", "chromaticities do not span a colour space"};
  Vec3d scale = inverse(primaries) * (xyz(white) / double(white.y));
  return Mat3d(primaries[0] * scale[0], primaries[1] * scale[1], primaries[2] * scale[2]);
}

constexpr Vec2 rec709_red{0.64f, 0.33f}, rec709_green{0.30f, 0.60f}, rec709_blue{0.15f, 0.06f}, d65{0.3127f, 0.3290f};

// Files print chromaticities with few digits, or print Rec. 709 as adapted to another white: a matrix this close to the
// identity is meant to be it.
bool is_identity(const Mat3& m) {
  constexpr float rounding = 5e-4f;
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row)
      if (std::abs(m[column][row] - (row == column ? 1.0f : 0.0f)) > rounding) return false;
  return true;
}

Result<Image> read_pixels(std::span<const uint8_t> bytes, const ExrHeader& header, const std::string& path) {
  MemoryInput stream(bytes, path);
  Imf::InputFile file(stream, 0);
  if (!file.isComplete()) return Error{path, "truncated: rows or tiles are missing"};
  const Imath::Box2i& window = file.header().dataWindow();
  if (window.min.x != header.x0 || window.min.y != header.y0 || window.max.x != header.x0 + header.width - 1 ||
      window.max.y != header.y0 + header.height - 1)
    return Error{path, "header has two data windows"};

  Image image(int(header.width), int(header.height));
  Imf::FrameBuffer pixels;
  auto add = [&](const char* name, float* base, size_t step) {
    pixels.insert(name, Imf::Slice::Make(Imf::FLOAT, base, window, step, step * size_t(header.width)));
  };
  bool has_color = header.find("R") || header.find("G") || header.find("B");
  const char* names[] = {"R", "G", "B"};
  for (int c = 0; has_color && c < 3; ++c)
    if (header.find(names[c])) add(names[c], &image.rgb[0][c], sizeof(Vec3));
  if (!has_color) add("Y", &image.rgb[0][0], sizeof(Vec3));
  if (header.find("A")) image.alpha.resize(image.rgb.size()), add("A", image.alpha.data(), sizeof(float));
  file.setFrameBuffer(pixels);
  file.readPixels(window.min.y, window.max.y);

  if (!has_color)
    for (Vec3& c : image.rgb) c = Vec3(c.x);
  for (float& a : image.alpha) a = std::fmin(std::fmax(a, 0.0f), 1.0f);
  if (has_color && Imf::hasChromaticities(file.header())) {
    Imf::Chromaticities c = Imf::chromaticities(file.header());
    auto vec = [](Imath::V2f v) { return Vec2(v.x, v.y); };
    auto matrix = rec709_from_primaries(vec(c.red), vec(c.green), vec(c.blue), vec(c.white));
    if (!matrix) return Error{path, matrix.error().message};
    if (!is_identity(*matrix))
      for (Vec3& v : image.rgb) v = *matrix * v;
  }
  return image;
}

}  // namespace

Result<Mat3> rec709_from_primaries(Vec2 red, Vec2 green, Vec2 blue, Vec2 white) {
  auto source = xyz_from_rgb(red, green, blue, white),
       target = xyz_from_rgb(rec709_red, rec709_green, rec709_blue, d65);
  if (!source) return source.error();
  const Mat3d cone = transpose(Mat3d(0.8951, 0.2664, -0.1614, -0.7502, 1.7135, 0.0367, 0.0389, -0.0685, 1.0296));
  const Vec3d ones(1);
  Vec3d from = cone * (*source * ones), to = cone * (*target * ones);
  for (int i = 0; i < 3; ++i)
    if (!(from[i] > 1e-6)) return Error{"", "white point is not a colour"};
  Mat3d adapt = inverse(cone) * Mat3d(to.x / from.x, 0, 0, 0, to.y / from.y, 0, 0, 0, to.z / from.z) * cone;
  return Mat3(inverse(*target) * adapt * *source);
}

Result<Image> load_exr(std::span<const uint8_t> bytes, const std::string& path) {
  if (image_format(bytes) != ImageFormat::exr) return Error{path, "not an OpenEXR file"};
  auto header = read_header(bytes, path);
  if (!header) return header.error();
  for (const char* name : {"RY", "BY"})
    if (header->find(name)) return Error{path, "luminance/chroma pixels are not read, only R, G, B or Y alone"};
  bool any = false;
  for (const char* name : {"R", "G", "B", "Y", "A"}) {
    const auto* channel = header->find(name);
    if (channel && !channel->full) return Error{path, std::string("channel ") + name + " is subsampled"};
    any |= channel && name[0] != 'A';
  }
  if (!any) return Error{path, "no channel named R, G, B or Y"};
  try {
    return read_pixels(bytes, *header, path);
  } catch (const std::bad_alloc&) {
    return Error{path, "out of memory"};
  } catch (const std::exception& e) {
    return Error{path, "bad OpenEXR file: " + one_line(e.what(), path)};
  }
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
  constexpr float half_max = 65504;
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
