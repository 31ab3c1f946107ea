#pragma once
// The little syntaxes that users type, in requests and on the command line. Errors name the option given as `option`
// and say what was expected.
#include <lambent/basis/sh.h>
#include <lambent/compress/cpca.h>
#include <lambent/core/camera.h>
#include <lambent/core/result.h>
#include <lambent/relight/local_light.h>
#include <lambent/scene/reflection.h>

#include <array>
#include <initializer_list>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace lambent {

// Strictly `count` finite numbers, separated by commas.
Result<std::vector<float>> parse_numbers(const std::string& text, size_t count, const std::string& option);

// "NAME=R,G,B" or "NAME=S": a name (which may hold '=') and three numbers or one for all, none negative.
struct NamedColor {
  std::string name;
  Vec3 color;
};
Result<NamedColor> parse_named_color(const std::string& text, const std::string& option);

// "WIDTHxHEIGHT", each from 1 to 16384.
Result<std::array<int, 2>> parse_size(const std::string& text, const std::string& option);

// "EX,EY,EZ,TX,TY,TZ,FOV": eye, target, vertical degrees; nothing for "auto". Here and below places
// are in the file's space, and `origin` is Scene::origin.
Result<std::optional<Camera>> parse_camera(const std::string& text, Vec3d origin = Vec3d(0));

// A camera and a picture's size; "auto" just fits the whole scene in, an added floor left out.
struct View {
  Camera camera;
  int width = 0, height = 0;
};
Result<View> parse_view(const std::string& camera, const std::string& size, const Scene& scene);

// "YAW,PITCH,ROLL", degrees about +Y, +X, +Z; "" turns nothing.
Result<Mat3> parse_rotation(const std::string& text, const std::string& option);

// "none", "hann", "lanczos", "auto".
extern const std::map<std::string, ShWindow> window_names;
Result<ShWindow> parse_window(const std::string& text);

// "X,Y,Z,RADIUS,R,G,B" each.
Result<std::vector<SphereLamp>> parse_sphere_lamps(const std::vector<std::string>& texts, Vec3d origin = Vec3d(0));

// "FROM:TO[:STEP]", seconds: at most 64 times.
Result<std::vector<double>> parse_frames(const std::string& text);

// "FILE@X,Y,Z[,SCALE]".
struct Insertion {
  std::string path;
  Vec3 foot;
  float scale = 1;
  bool operator==(const Insertion&) const = default;
};
Result<Insertion> parse_insertion(const std::string& text, Vec3d origin = Vec3d(0));

// "diffuse", "materials", or a BRDF (brdf/parse_brdf.h) for all surfaces; reads measured ones from their files.
Result<Reflection> parse_reflection(const std::string& text);

// "NAME=BRDF" or "NAME=textured:BRDF" each: added to reflection.named. Errors: a material that the scene has not.
Result<void> parse_materials(const std::vector<std::string>& texts, const Scene& scene, Reflection& reflection);

// "cpca:CLUSTERS,RANK".
Result<void> parse_cpca(const std::string& text, CpcaOptions& options);

// Before long work: the folder of `path` exists and can be written, and the extension is one of those given.
Result<void> check_output(const std::string& path, std::initializer_list<const char*> extensions);

}  // namespace lambent
