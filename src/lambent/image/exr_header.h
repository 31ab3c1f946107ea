#pragma once
// A first look at an OpenEXR file's headers, in which every size is checked, so that the library never allocates for
// one that lies; and which channels are the picture. Layout: "OpenEXR File Layout" of the project's documentation.
#include <lambent/image/image.h>

#include <array>
#include <string_view>

namespace lambent {

struct ExrChannel {
  std::string name;
  int type = 0;                // 0 whole numbers, 1 half floats, 2 floats
  int x_step = 1, y_step = 1;  // pixels a sample
};

// One part; a file without parts has one.
struct ExrPart {
  std::string name;
  int64_t x0 = 0, y0 = 0, width = 0, height = 0;                          // data window
  int64_t shown_x0 = 0, shown_y0 = 0, shown_width = 0, shown_height = 0;  // display window
  std::vector<ExrChannel> channels;
  uint64_t bytes_a_pixel = 0;
  uint64_t tile_width = 0, tile_height = 0;  // 0: rows
  int compression = 0;
  bool deep = false;
  Envmap envmap = Envmap::unsaid;

  const ExrChannel* find(std::string_view channel) const;
};

struct ExrHeader {
  std::vector<ExrPart> parts;
  bool several = false;  // the version says that there are parts
  bool flagged = false;  // it says so, but the header is that of a file without: read as such
};
// Errors: no OpenEXR, truncated, damaged, sizes beyond image.h's or than the bytes can hold, deep pixels alone.
Result<ExrHeader> read_exr_header(std::span<const uint8_t> bytes, const std::string& path);

// The channels that make a picture, by their full names; empty where there is none.
struct ExrLayer {
  size_t part = 0;
  std::string name;                                // of the layer: "ViewLayer.Combined"; empty: without
  std::string red, green, blue, alpha, y, ry, by;  // ry and by only beside y
  bool has_color() const { return !red.empty() || !green.empty() || !blue.empty(); }
};
// The layer called `wanted`: by its name, its part's, or PART/LAYER, as the errors list them. Where that is empty, the
// one that can be meant: the only one of colour or luminance, or the one without a name, or the one that is
// called as pictures of everything are (Combined, beauty, RGBA); the last with a warning. Errors: none,
// or several, named.
Result<ExrLayer> choose_exr_layer(const ExrHeader& header, const std::string& wanted, const std::string& path,
                                  std::vector<std::string>& warnings);

}  // namespace lambent
