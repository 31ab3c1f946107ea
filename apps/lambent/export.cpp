#include "commands.h"
#include "export_lightmap.h"
#include "export_npy.h"
#include "export_three_probes.h"
#include "web.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <memory>

namespace lambent::tool {
namespace {

namespace fs = std::filesystem;

struct ExportCommand {
  WebOptions web;
  std::string folder, three, moz, godot, unity, npy, three_probes, convention = "pifu";
  LightmapExport lightmap;
};

// The folder of an earlier export, or nothing: all else is somebody's work.
Result<void> check_target(const fs::path& target) {
  std::error_code status;
  if (!fs::exists(fs::symlink_status(target, status))) {
    const fs::path parent = target.has_parent_path() ? target.parent_path() : fs::path(".");
    if (!fs::is_directory(parent, status))
      return Error{target.string(), "cannot be written: no folder " + parent.string()};
    return {};
  }
  if (!fs::is_directory(target, status)) return Error{target.string(), "is there already and is not a folder"};
  if (!fs::is_empty(target, status) && !fs::is_regular_file(target / "lambent.json", status))
    return Error{target.string(), "is there already and is no earlier export: it is left alone"};
  return {};
}

// All files into a new folder beside the target, which then takes its place.
Result<void> write_folder(const fs::path& target, const WebFiles& files, const Progress& progress) {
  const fs::path fresh = target.string() + ".lambent-part" + std::to_string(::getpid()),
                 old = target.string() + ".old" + std::to_string(::getpid());
  std::error_code status;
  remove_stale_temporaries(target.string());
  fs::create_directory(fresh, status);
  // As long as it is locked nobody takes it for one that was left behind.
  const int lock = ::open(fresh.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (status || lock < 0 || ::flock(lock, LOCK_EX | LOCK_NB) != 0)
    return Error{target.string(), std::string("cannot be written: ") + std::strerror(errno)};
  const std::unique_ptr<const int, void (*)(const int*)> held(&lock, [](const int* fd) { ::close(*fd); });
  const auto give_up = [&](Error error) {
    std::error_code ignored;
    fs::remove_all(fresh, ignored);
    return error;
  };
  for (const auto& [name, file] : files) {
    if (progress.cancelled()) return give_up({"", "cancelled"});
    fs::create_directories((fresh / name).parent_path(), status);
    if (status) return give_up({target.string(), "cannot be written: " + status.message()});
    if (auto ok = write_file_atomically((fresh / name).string(), file.bytes()); !ok) return give_up(ok.error());
  }
  const bool replaces = fs::exists(target, status);
  if (replaces) fs::rename(target, old, status);
  if (!status) fs::rename(fresh, target, status);
  if (status) {
    const std::string why = status.message();
    if (replaces && !fs::exists(target, status)) fs::rename(old, target, status);
    return give_up({target.string(), "cannot be written: " + why});
  }
  if (replaces) fs::remove_all(old, status);
  return {};
}

// What the page alone shows says nothing of other files.
Result<void> check_options(const ExportCommand& o, const CLI::App& command) {
  const bool web = !o.folder.empty(), lightmap = !web && o.npy.empty() && o.three_probes.empty();
  for (const char* name : {"--compare", "--reference", "--camera", "--exposure", "--tone", "--pack", "--insert"})
    if (!web && command.count(name) > 0) return Error{name, "goes with --web alone", true};
  for (const char* name : {"--env", "--env-rotate"})
    if (!o.npy.empty() && command.count(name) > 0) return Error{name, "does not go with --npy", true};
  for (const char* name : {"--per-object", "--sky-columns", "--probes"})
    if (!lightmap && command.count(name) > 0)
      return Error{name, "goes with --three, --moz-lightmap, --godot or --unity", true};
  if (!web && o.web.env.size() > 1) return Error{"--env", "takes one environment here", true};
  return {};
}

int run_export(Context& context, const ExportCommand& o, const CLI::App& command) {
  context.cleans_up = true;
  if (auto ok = check_options(o, command); !ok) return fail(ok.error());
  for (const auto& [prefix, target] :
       {std::pair(&o.three, LightmapTarget::three), std::pair(&o.moz, LightmapTarget::moz),
        std::pair(&o.godot, LightmapTarget::godot), std::pair(&o.unity, LightmapTarget::unity)}) {
    if (prefix->empty()) continue;
    LightmapExport lightmap = o.lightmap;
    lightmap.baked = o.web.baked, lightmap.prefix = *prefix, lightmap.target = target;
    if (!o.web.env.empty()) lightmap.light.env = o.web.env[0];
    lightmap.light.rotate = o.web.rotate;
    return export_lightmap(context, lightmap);
  }
  if (!o.three_probes.empty())
    return export_three_probes(context, o.web.baked, o.three_probes,
                               {o.web.env.empty() ? std::string() : o.web.env[0], o.web.rotate});
  if (!o.npy.empty()) return export_npy(context, o.web.baked, o.npy, o.convention);
  fs::path target = fs::path(o.folder).lexically_normal();
  if (!target.has_filename()) target = target.parent_path();  // "site/"
  if (auto ok = check_target(target); !ok) return fail(ok.error());
  auto files = web_files(o.web, {&context.progress, [](const std::string& message) { warn(message); }});
  if (!files) return fail(files.error());
  if (auto ok = write_folder(target, *files, context.progress); !ok) return fail(ok.error());
  size_t bytes = 0;
  for (const auto& [name, file] : *files) bytes += file.bytes().size();
  if (context.json) print_json({{"output", target.string()}, {"files", files->size()}, {"bytes", bytes}});
  else
    fmt::print("{}\n  {} files, {}: any web server can show it\n", target.string(), files->size(),
               human_bytes(double(bytes)));
  return success;
}

}  // namespace

void add_export(CLI::App& app, Run& run) {
  auto o = std::make_shared<ExportCommand>();
  CLI::App* c = app.add_subcommand("export", "Write a baked file in another form");
  o->web.add_to(*c);
  CLI::Option_group* target = c->add_option_group("Target");
  target->add_option("--web", o->folder,
                     "Folder to write: the page that `view` serves, with its data, for any web server");
  target->add_option(
      "--three", o->three,
      "PREFIX of pictures for three.js: a lightmap's irradiance, with a scene that wears it (MOZ_lightmap), or "
      "LightProbe coefficients a texel");
  target->add_option("--moz-lightmap", o->moz,
                     "A GLB to write: the scene with its own materials and the lightmap as MOZ_lightmap");
  auto* godot = target->add_option(
      "--godot", o->godot,
      "PREFIX for Godot: pictures, of sh:2 or sh:3 the layers of a directional lightmap; a LightmapGIData, the scene "
      "with UV2 and a script");
  target->add_option("--unity", o->unity,
                     "PREFIX for Unity: colours and, of sh:2 or sh:3, directions; the scene with UV2 and scripts");
  auto* npy = target->add_option(
      "--npy", o->npy, "Folder for NumPy: transfer by the input's vertices, for PRT data sets, and the faces");
  c->add_option(
      "--pack", o->web.pack,
      "With --web: baked files a third or less as large, for the page and the three.js package alone. Relative "
      "RMS error that transfer is rounded to, or auto: a quarter of the bake's own, 0.005 at most");
  c->add_option("--insert", o->web.insert,
                "With --web: FILE@X,Y,Z[,SCALE]: put a small diffuse object there, lit by the scene's lattice; may be "
                "given again")
      ->allow_extra_args(false)
      ->take_all();
  c->add_option("--convention", o->convention,
                "With --npy: whose light it goes with, and whose file names: pifu, icon, lambent, three, unity, godot, "
                "gltf-ibl, filament, directx")
      ->capture_default_str()
      ->needs(npy);
  c->add_option("--godot-version", o->lightmap.godot_version, "With --godot: whose layout LightmapGIData has")
      ->check(CLI::IsMember({"4.3", "4.4", "4.5", "4.6"}))
      ->capture_default_str()
      ->needs(godot);
  c->add_flag("--per-object", o->lightmap.per_object, "Of a lightmap: an atlas of its own for each object, by name");
  c->add_flag("--sky-columns", o->lightmap.sky_columns,
              "Of a lightmap with harmonics: a picture for each, which a shader sums by the sky's coefficients "
              "(--env's are written beside them)");
  c->add_option("--probes", o->lightmap.probes,
                "Of a lightmap: probes too, from this file, baked with --lattice, in the light of --env");
  target->add_option(
      "--three-probes", o->three_probes,
      "PREFIX for three.js: the light of a file baked with --lattice under --env, as LightProbeGrid keeps "
      "it, and the script that loads it");
  target->require_option(1);
  c->callback([o, c, &run] { run = [o, c](Context& context) { return run_export(context, *o, *c); }; });
}

}  // namespace lambent::tool
