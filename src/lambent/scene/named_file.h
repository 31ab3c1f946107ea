#pragma once
#include <lambent/scene/scene.h>

namespace lambent {

// A file that an OBJ, MTL or PLY names as some machine knew it: "a.png", "..\textures\a.png", "C:\yard\textures\a.png",
// "/home/me/a.png". It is looked for in `folder` alone, by as many of its last steps as there are folders for, case
// aside where nothing is spelt so. Errors: not found; those of read_external_file.
Result<std::vector<uint8_t>> read_named_file(std::string_view name, const std::string& folder,
                                             const std::string& referrer);

// The same for a picture, decoded (textures.h), its name as a short_name. Errors: those of decode_texture too.
Result<Texture> read_named_picture(std::string_view name, const std::string& folder, const std::string& referrer);

// Pictures that could not be had: the materials do without, and one warning says so.
struct LostPictures {
  std::string first;
  size_t count = 0;
  void add(const Error& error);
  void tell(Scene& scene) const;
};

}  // namespace lambent
