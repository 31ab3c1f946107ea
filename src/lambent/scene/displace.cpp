#include <lambent/scene/clean.h>
#include <lambent/scene/displace.h>

#include <unordered_map>

namespace lambent {
namespace {

// Vertices that share a place and nearly a normal get one number; those shade smoothly into each other.
std::vector<uint32_t> number_smooth(const std::vector<uint32_t>& place, const std::vector<Vec3>& normals) {
  std::vector<Vec3> rounded;
  for (Vec3 n : normals) rounded.push_back(round(n * 4096.0f));
  const std::vector<uint32_t> direction = number_positions(rounded).ids;
  std::unordered_map<uint64_t, uint32_t> numbers;
  std::vector<uint32_t> out;
  for (size_t v = 0; v < place.size(); ++v)
    out.push_back(numbers.try_emplace(uint64_t(place[v]) << 32 | direction[v], uint32_t(numbers.size())).first->second);
  return out;
}

}  // namespace

Result<void> displace(Scene& scene, const std::function<float(Vec2)>& height, Vec2 tile) {
  const std::vector<Vec2>& uv = scene.texcoords[0];
  if (uv.empty()) return Error{scene.path, "has no texture coordinates to displace it by"};
  const size_t n = scene.positions.size();
  const std::vector<uint32_t> place = number_positions(scene.positions).ids,
                              smooth = number_smooth(place, scene.normals);
  std::vector<double> area(n), covered(n);
  std::vector<Vec3> normals(n, Vec3(0.0f));  // by place
  for (const Triangle& t : scene.triangles) {
    const Vec2 d1 = (uv[t.v[1]] - uv[t.v[0]]) * tile, d2 = (uv[t.v[2]] - uv[t.v[0]]) * tile;
    const double a = double(area_length(area_normal(scene, t))),
                 c = std::abs(double(d1.x) * d2.y - double(d1.y) * d2.x);
    for (uint32_t v : t.v) area[place[v]] += a, covered[place[v]] += c;
  }
  std::vector<float> moves(n);
  std::vector<uint32_t> count(n);
  for (size_t v = 0; v < n; ++v) {
    const size_t p = place[v];
    const double side = covered[p] > 0 ? std::sqrt(area[p] / covered[p]) : 0;
    moves[p] += float(side) * height(uv[v] * tile), ++count[p], normals[p] += scene.normals[v];
  }
  for (size_t v = 0; v < n; ++v) {
    const size_t p = place[v];
    scene.positions[v] += normalize_or(normals[p], scene.normals[v]) * (moves[p] / float(count[p]));
  }
  std::fill(normals.begin(), normals.end(), Vec3(0.0f));  // by smooth number from here
  for (const Triangle& t : scene.triangles) {
    const Vec3 a = area_normal(scene, t);
    for (uint32_t v : t.v) normals[smooth[v]] += a;
  }
  for (size_t v = 0; v < n; ++v) scene.normals[v] = normalize_or(normals[smooth[v]], scene.normals[v]);
  return {};
}

}  // namespace lambent
