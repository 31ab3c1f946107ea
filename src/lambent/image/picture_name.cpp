#include <lambent/image/picture_name.h>

#include <lambent/core/file.h>

#include <filesystem>

namespace lambent {

PictureName picture_name(const std::string& given) {
  std::error_code ignored;
  PictureName first{given,
                    {}};  // what there is, else the first that it may be: names of layers may have a # themselves
  for (size_t at = given.find('#'); at != given.npos; at = given.find('#', at + 1)) {
    PictureName name{given.substr(0, at), given.substr(at + 1)};
    if (file_extension(name.file) != "exr" || name.layer.empty()) continue;
    if (std::filesystem::exists(given, ignored)) break;
    if (std::filesystem::exists(name.file, ignored)) return name;
    if (first.layer.empty()) first = std::move(name);
  }
  return std::filesystem::exists(given, ignored) ? PictureName{given, {}} : first;
}

}  // namespace lambent
