#include "web.h"

#include "options.h"

#include <lambent/baked/baked_file.h>
#include <lambent/baked/packed.h>
#include <lambent/core/glb.h>
#include <lambent/core/uri.h>
#include <lambent/image/image.h>
#include <lambent/image/tone.h>
#include <lambent/pipeline/browser.h>
#include <lambent/pipeline/draw_insert.h>
#include <lambent/scene/append.h>
#include <lambent/scene/load.h>

#include <stdlib.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <optional>

namespace lambent::tool {
namespace {

namespace fs = std::filesystem;

// Where scripts/web (or an install) leaves the page, seen from the program: share/lambent/web of its prefix, or
// build/web of the source tree that it was built in.
Result<fs::path> page_folder() {
  std::error_code status;
  const fs::path program = fs::read_symlink("/proc/self/exe", status).parent_path();
  for (const char* place : {"../share/lambent/web", "../../web"}) {
    const fs::path folder = (program / place).lexically_normal();
    if (fs::is_regular_file(folder / "index.html", status)) return folder;
  }
  return Error{(program / "../../web").lexically_normal().string(),
               "the web page is not there: build it with scripts/web"};
}

const char* media_type(const std::string& extension) {
  static const std::map<std::string, const char*> types{{"html", "text/html; charset=utf-8"},
                                                        {"js", "text/javascript; charset=utf-8"},
                                                        {"css", "text/css; charset=utf-8"},
                                                        {"json", "application/json"},
                                                        {"svg", "image/svg+xml"},
                                                        {"png", "image/png"},
                                                        {"glb", "model/gltf-binary"},
                                                        {"gltf", "model/gltf+json"},
                                                        {"wasm", "application/wasm"},
                                                        {"exr", "image/x-exr"}};
  const auto known = types.find(extension);
  return known == types.end() ? "application/octet-stream" : known->second;
}

Result<void> add_page(WebFiles& files) {
  auto folder = page_folder();
  if (!folder) return folder.error();
  std::error_code status;
  for (const auto& entry : fs::recursive_directory_iterator(*folder, status)) {
    if (!entry.is_regular_file(status)) continue;
    const std::string path = entry.path().string();
    auto file = MappedFile::open(path);
    if (!file) return file.error();
    files[entry.path().lexically_relative(*folder).generic_string()] = {media_type(file_extension(path)),
                                                                        std::move(*file)};
  }
  return {};
}

// The files that a .gltf names, under names of ours, beside it; the document then names these.
Result<void> add_named_files(WebFiles& files, nlohmann::json& document, const std::string& path,
                             const std::string& stem) {
  for (const char* list : {"buffers", "images"})
    for (size_t i = 0; i < (document.contains(list) ? document[list].size() : 0); ++i) {
      nlohmann::json& item = document[list][i];
      if (!item.contains("uri") || !item["uri"].is_string() || is_data_uri(item["uri"].get<std::string>())) continue;
      auto found = find_external_file(item["uri"].get<std::string>(), folder_of(path), path);
      if (!found && list == std::string_view("images")) continue;  // the scene does without, too
      if (!found) return found.error();
      auto file = MappedFile::open(*found);
      if (!file) return file.error();
      const std::string ending = file_extension(*found), kind = media_type(ending);
      const std::string name = stem + "." + list + "-" + std::to_string(i) + "." + (ending.empty() ? "bin" : ending);
      files["data/" + name] = {kind, std::move(*file)};
      item["uri"] = encode_uri(name);
    }
  return {};
}

struct AddedFile {
  std::string name;       // data/STEM.glb or data/STEM.gltf
  bool by_lamps = false;  // direct-to-indirect transport, which lamps light and no environment
  std::optional<FixedView> view;
  // Light in free space, where objects may be put; 0 where there is none.
  Lattice lattice;
  int lattice_order = 0;
  Vec3d origin;
};
Result<float> packing_error(const std::string& text, std::span<const uint8_t> bytes, const std::string& path) {
  if (text == "auto") return default_packing_error(bytes, path);
  auto given = parse_numbers(text, 1, "--pack");
  if (!given) return given.error();
  if (!((*given)[0] >= 1e-5 && (*given)[0] <= 0.1)) return Error{"--pack", "must be auto or from 0.00001 to 0.1", true};
  return float((*given)[0]);
}

Result<AddedFile> add_baked(WebFiles& files, const std::string& path, const std::string& stem,
                            const std::string& pack) {
  auto file = MappedFile::open(path);
  if (!file) return file.error();
  auto whole = load_baked(*file, path);
  if (!whole) return whole.error();
  if (auto ok = check_file_for_browser(*whole, path); !ok) return ok.error();
  AddedFile added;
  added.by_lamps = std::holds_alternative<IndirectTransfer>(whole->surface.store);
  if (const auto* fixed = std::get_if<FixedView>(&whole->surface.where)) added.view = *fixed;
  if (const Field* free_space = lattice_of(*whole)) {
    added.lattice = std::get<LatticePlacement>(free_space->where).lattice;
    added.lattice_order = std::get<IncidentRows>(free_space->rows).order;
  }
  added.origin = whole->scene.origin;
  auto chunks = split_gltf(file->bytes(), path);
  if (!chunks) return chunks.error();
  const std::string ending = chunks->binary.data() ? "glb" : "gltf", name = "data/" + stem + "." + ending;
  added.name = name;
  if (!pack.empty()) {
    auto error = packing_error(pack, file->bytes(), path);
    if (!error) return error.error();
    auto packed = pack_baked(file->bytes(), *error, path);
    if (!packed) return packed.error();
    files[name] = {media_type("glb"), std::move(packed->bytes)};
    return added;
  }
  if (ending == "glb") {
    files[name] = {media_type("glb"), std::move(*file)};
    return added;
  }
  if (auto ok = add_named_files(files, chunks->json, path, stem); !ok) return ok.error();
  files[name] = {media_type("gltf"), chunks->json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)};
  return added;
}

// A scene as a .glb in memory.
Result<MappedFile> as_file(const Baked& baked) {
  std::string folder = (fs::temp_directory_path() / "lambent-XXXXXX").string();
  if (!::mkdtemp(folder.data())) return Error{folder, "cannot be made: " + std::generic_category().message(errno)};
  const std::string path = folder + "/object.glb";
  auto saved = save_baked(path, baked);
  auto file = saved ? MappedFile::open(path) : Result<MappedFile>(saved.error());
  std::error_code status;
  fs::remove_all(folder, status);  // what is mapped stays
  return file;
}

// Objects to be put into the scene, each file baked alone and once, and in the manifest where they stand.
Result<void> add_inserts(WebFiles& files, nlohmann::json& manifest, const WebOptions& o, const AddedFile& baked,
                         const Job& job) {
  if (o.insert.empty()) return {};
  const auto refuse = [](const std::string& why) { return Error{"--insert", why, true}; };
  if (baked.by_lamps) return refuse("does not go with direct-to-indirect transport in the page: see `lambent render`");
  if (baked.view) return refuse("puts objects among surfaces, and a fixed view has none");
  if (baked.lattice_order == 0)
    return Error{o.baked, "has no light in free space for --insert: bake it with --lattice"};
  if (baked.origin != Vec3d(0)) return refuse("does not go with scenes far from the origin in the page");
  if (o.insert.size() > max_drawn_inserts)
    return refuse(fmt::format("puts {} objects at most into a scene of the page", max_drawn_inserts));
  std::map<std::string, std::string> names;  // by path
  manifest["inserts"] = manifest["insert"] = nlohmann::json::array();
  for (const std::string& text : o.insert) {
    auto insertion = parse_insertion(text);
    if (!insertion) return insertion.error();
    auto placed = place_object(*insertion, baked.lattice, job);
    if (!placed) return placed.error();
    std::string name = names[insertion->path];
    if (name.empty()) {
      const std::string own = fs::path(insertion->path).filename().string();
      const auto taken = [&](const std::string& n) {
        return n == "ball" ||
               std::any_of(names.begin(), names.end(), [&](const auto& known) { return known.second == n; });
      };
      name = own;
      for (int i = 2; taken(name); ++i) name = fmt::format("{} ({})", own, i);
      names[insertion->path] = name;
      if (placed->positions.size() > max_drawn_insert_vertices)
        return Error{insertion->path, fmt::format("has {} vertices, and an object in the page {} at most",
                                                  placed->positions.size(), max_drawn_insert_vertices)};
      auto object = load_scene(insertion->path);
      if (!object) return object.error();
      place_scene(*object, Vec3(0), 1), object->origin = Vec3d(0);
      auto made = bake_object(*insertion, std::move(*object), baked.lattice_order, job);
      if (!made) return made.error();
      auto file =
          as_file(make_baked(std::move(made->scene), made->receivers, std::move(made->transfer), DiffuseRows{}));
      if (!file) return file.error();
      const std::string path = fmt::format("data/object-{}.glb", manifest["inserts"].size());
      files[path] = {media_type("glb"), std::move(*file)};
      manifest["inserts"].push_back({{"name", name}, {"file", path}});
    }
    const Vec3 p = insertion->foot;
    manifest["insert"].push_back(name + fmt::format("@{},{},{}", p.x, p.y, p.z) +
                                 (insertion->scale == 1 ? "" : fmt::format(",{}", insertion->scale)));
  }
  return {};
}

// What the page has no use for where lamps alone light the scene, by name.
Result<void> check_lamps_alone(const WebOptions& o) {
  const char* const option = !o.env.empty() ? "--env" : !o.rotate.empty() ? "--env-rotate" : nullptr;
  if (option)
    return Error{option,
                 "has no use in the page, where lamps alone light a file of direct-to-indirect transport: see "
                 "`lambent render`",
                 true};
  return {};
}

// Two files are drawn by one camera, which of a fixed view is the one that was baked in.
Result<void> check_views(const WebOptions& o, const AddedFile& baked, const AddedFile* compare) {
  if (baked.view && o.camera != "auto")
    return Error{"--camera", "has no use in the page for a fixed view, whose camera is baked in", true};
  if (!compare || (!baked.view && !compare->view)) return {};
  const FixedView *a = baked.view ? &*baked.view : nullptr, *b = compare->view ? &*compare->view : nullptr;
  if (a && b && a->width == b->width && a->height == b->height && a->camera.eye == b->camera.eye &&
      a->camera.target == b->camera.target && a->camera.fov == b->camera.fov)
    return {};
  return Error{"--compare", "is of another camera: of two fixed views both have one", true};
}

Result<void> add_map(WebFiles& files, const Image& image, const std::string& path, const std::string& name) {
  auto bytes = encode_exr(image, path, ExrPrecision::single);
  if (!bytes) return bytes.error();
  files[name] = {media_type("exr"), std::string(bytes->begin(), bytes->end())};
  return {};
}

}  // namespace

void WebOptions::add_to(CLI::App& command) {
  command.add_option("baked", baked, "Baked file, from `lambent bake`")->required();
  command.add_option("--env", env, "Environments to choose from, each as for render; the option may be repeated")
      ->allow_extra_args(false)
      ->take_all();
  command.add_option("--compare", compare, "A second baked file, to wipe against: with fewer bounces, say");
  command.add_option("--reference", reference,
                     "A picture of the same camera, to wipe against: .exr, or .png of --exposure 0 --tone none");
  command.add_option("--camera", camera, "EX,EY,EZ,TX,TY,TZ,FOV to begin with; or auto")->capture_default_str();
  command.add_option("--env-rotate", rotate, "YAW,PITCH,ROLL to begin with, degrees about +Y, +X, +Z");
  command.add_option("--exposure", exposure, "Stops to begin with; auto: as the page measures them")
      ->capture_default_str();
  command.add_option("--tone", tone, "Curve from light to the screen to begin with")
      ->check(CLI::IsMember({"neutral", "agx", "aces", "none"}))
      ->capture_default_str();
}

Result<WebFiles> web_files(const WebOptions& options, const Job& job) {
  auto display = parse_display(options.exposure, options.tone, {});
  if (!display) return display.error();
  nlohmann::json manifest{
      {"name", fs::path(options.baked).filename().string()}, {"exposure", display->exposure}, {"tone", options.tone}};
  if (options.exposure == "auto") manifest["exposure"] = "auto";
  auto camera = parse_camera(options.camera);
  if (!camera) return camera.error();
  if (*camera) {
    const Camera& c = **camera;
    manifest["camera"] = {c.eye.x, c.eye.y, c.eye.z, c.target.x, c.target.y, c.target.z, c.fov};
  }
  if (!options.rotate.empty()) {
    auto turn = parse_numbers(options.rotate, 3, "--env-rotate");
    if (!turn) return turn.error();
    manifest["rotate"] = *turn;
  }
  WebFiles files;
  auto baked = add_baked(files, options.baked, "scene", options.pack);
  if (!baked) return baked.error();
  if (auto ok = baked->by_lamps ? check_lamps_alone(options) : Result<void>(); !ok) return ok.error();
  if (auto ok = check_views(options, *baked, nullptr); !ok) return ok.error();
  manifest["baked"] = baked->name;
  if (!options.compare.empty()) {
    auto compare = add_baked(files, options.compare, "compare", options.pack);
    if (!compare) return compare.error();
    if (baked->by_lamps || compare->by_lamps)
      return Error{"--compare", "does not go with direct-to-indirect transport in the page", true};
    if (auto ok = check_views(options, *baked, &*compare); !ok) return ok.error();
    manifest["compare"] = compare->name;
  }
  if (auto ok = add_inserts(files, manifest, options, *baked, job); !ok) return ok.error();
  if (auto ok = add_page(files); !ok) return ok.error();
  if (!options.reference.empty()) {
    std::vector<std::string> warnings;
    auto image = load_image(options.reference, &warnings);
    if (!image) return image.error();
    warn(warnings);
    image->alpha.clear();
    if (auto ok = add_map(files, *image, options.reference, "data/reference.exr"); !ok) return ok.error();
    manifest["reference"] = "data/reference.exr";
  }
  manifest["environments"] = nlohmann::json::array();
  std::vector<std::string> specs = options.env;
  if (specs.empty() && !baked->by_lamps) specs.emplace_back("sky:elevation=35,azimuth=45");
  for (size_t i = 0; i < specs.size(); ++i) {
    auto env = load_light({specs[i], ""});
    if (!env) return env.error();
    const std::string name = "data/environment-" + std::to_string(i) + ".exr";
    if (auto ok = add_map(files, env->image, specs[i], name); !ok) return ok.error();
    const bool is_file = !specs[i].starts_with("sky:") && !specs[i].starts_with("uniform:");
    manifest["environments"].push_back({{"name", is_file ? env->name : specs[i]}, {"file", name}});
  }
  files["lambent.json"] = {media_type("json"),
                           manifest.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n"};
  return files;
}

}  // namespace lambent::tool
