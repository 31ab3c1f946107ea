#include <lambent/core/file.h>
#include <lambent/image/image.h>
#include <lambent/pipeline/parse.h>
#include <lambent/pipeline/relief.h>
#include <lambent/scene/displace.h>
#include <lambent/scene/refine.h>

#include <numeric>

namespace lambent {

Result<HeightMap> load_height_map(const std::string& path) {
  auto picture = load_image(path);
  if (!picture) return picture.error();
  const std::string extension = file_extension(path);
  const bool encoded = extension == "png" || extension == "jpg" || extension == "jpeg";
  HeightMap map{picture->width, picture->height, {}};
  for (Vec3 p : picture->rgb) map.values.push_back(encoded ? srgb_encode(luminance(p)) : luminance(p));
  return map;
}

Result<HeightField> load_heights(const std::string& path, int size, float depth) {
  auto map = load_height_map(path);
  if (!map) return map.error();
  auto field = make_height_field(map->values, map->width, map->height, size, depth);
  if (!field) return Error{path, field.error().text()};
  return field;
}

Result<void> displace_scene(Scene& scene, const Displacement& o) {
  constexpr size_t most_triangles = size_t{1} << 25;
  auto tile = parse_numbers(o.tile, 2, "--tile");
  if (!tile) return tile.error();
  auto field = load_heights(o.heights, o.size, o.depth);
  if (!field) return field.error();
  const std::vector<Vec2>& uv = scene.texcoords[0];
  if (uv.empty()) return Error{scene.path, "has no texture coordinates to displace it by"};
  const Vec2 repeat((*tile)[0], (*tile)[1]);
  double area = 0, covered = 0;
  for (const Triangle& t : scene.triangles) {
    const Vec2 a = (uv[t.v[1]] - uv[t.v[0]]) * repeat, b = (uv[t.v[2]] - uv[t.v[0]]) * repeat;
    const double c = std::abs(double(a.x) * b.y - double(a.y) * b.x);
    if (c > 0) covered += c, area += area_length(area_normal(scene, t));
  }
  if (!(covered > 0 && area > 0)) return Error{scene.path, "has texture coordinates that cover nothing"};
  if (auto ok = split_long_edges(scene, float(0.8 * std::sqrt(area / covered) / o.size), most_triangles); !ok)
    return ok.error();
  const double mean = std::accumulate(field->heights.begin(), field->heights.end(), 0.0) /
                      double(field->heights.size());
  return displace(
      scene, [&](Vec2 at) { return float(sample_heights(field->heights, field->size, field->size, at) - mean); },
      repeat);
}

}  // namespace lambent
