#include <lambent/image/picture_name.h>

#include <lambent/core/file.h>

#include <filesystem>

namespace lambent {

PictureName picture_name(const std::string& given) {
  std::error_code ignored;
  // Layers' names may have a # themselves, so that the first one after .exr counts.
  for (size_t at = given.find('#'); at != given.npos; at = given.find('#', at + 1)) {
    if (file_extension(given.substr(0, at)) != "exr") continue;
    if (std::filesystem::exists(given, ignored)) break;
    return {given.substr(0, at), given.substr(at + 1)};
  }
  return {given, {}};
}

}  // namespace lambent
