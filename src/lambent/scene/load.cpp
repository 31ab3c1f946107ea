#include <lambent/scene/load.h>

#include <lambent/scene/gltf.h>

namespace lambent {

Result<Scene> load_scene(const std::string& path) {
  const std::string extension = file_extension(path);
  const bool gltf = extension == "gltf" || extension == "glb";
  if (!gltf && extension != "obj" && extension != "ply") {
    return Error{path, (extension.empty() ? "no extension" : "unknown extension \"." + extension + "\"") +
                           std::string("; known are .gltf, .glb, .obj and .ply")};
  }
  auto file = MappedFile::open(path);
  if (!file) return file.error();
  const std::string folder = folder_of(path);
  auto scene = gltf               ? load_gltf(*file, path, folder)
             : extension == "obj" ? load_obj(file->bytes(), path, folder)
                                  : load_ply(file->bytes(), path, folder);
  if (!scene) return scene.error();
  scene->path = path;
  scene->hash = content_hash(file->bytes());
  return scene;
}

}  // namespace lambent
