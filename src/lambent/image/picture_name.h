#pragma once
#include <string>

namespace lambent {

// What users type for a picture: FILE, or FILE.exr#LAYER for one of several that an OpenEXR file has. A file that is
// called so as a whole is that file.
struct PictureName {
  std::string file, layer;  // layer: empty where none is said
};
PictureName picture_name(const std::string& given);

}  // namespace lambent
