// Follows: local-deformable-prt, section 6 (local patches from height fields and meshes).
#include <lambent/bake/patch.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/receivers/atlas.h>

namespace lambent {

double sample_heights(std::span<const float> values, int width, int height, Vec2d uv) {
  if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) return 0;
  uv = (uv - floor(uv)) * Vec2d(width, height) - 0.5;
  const int i = int(std::floor(uv.x)), j = int(std::floor(uv.y));
  const double fx = uv.x - i, fy = uv.y - j;
  auto at = [&](int a, int b) {
    return double(values[size_t((b + height) % height) * size_t(width) + size_t((a + width) % width)]);
  };
  return (1 - fy) * ((1 - fx) * at(i, j) + fx * at(i + 1, j)) + fy * ((1 - fx) * at(i, j + 1) + fx * at(i + 1, j + 1));
}

Result<HeightField> make_height_field(std::span<const float> values, int width, int height, int size, float depth) {
  LAMBENT_CHECK(values.size() == size_t(width) * size_t(height));
  if (width < 2 || height < 2)
    return Error{"", "a height map needs at least 2 x 2 pixels, and this has " + std::to_string(width) + " x " +
                         std::to_string(height)};
  if (size < 2 || size > 1024) return Error{"size", "must lie between 2 and 1024"};
  if (!(std::abs(depth) <= 10)) return Error{"depth", "must lie between -10 and 10 sides of the patch"};
  for (float v : values)
    if (!std::isfinite(v)) return Error{"", "a height is not a finite number"};
  HeightField field{size, std::vector<float>(size_t(size) * size_t(size))};
  // Over a texel's extent, the mean of the picture, taken as piecewise constant where it is finer and linear where it
  // is coarser.
  const int fine = std::max(1, std::max(width, height) / size) * 2;
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i) {
      double sum = 0;
      for (int b = 0; b < fine; ++b)
        for (int a = 0; a < fine; ++a)
          sum += sample_heights(values, width, height, {(i + (a + 0.5) / fine) / size, (j + (b + 0.5) / fine) / size});
      field.heights[size_t(j * size + i)] = float(sum / (fine * fine) * depth);
    }
  return field;
}

double seam_jump(const HeightField& f) {
  const size_t n = size_t(f.size);
  double seam = 0, inside = 0;
  for (size_t j = 0; j < n; ++j)
    for (size_t i = 0; i < n; ++i) {
      const double across = f.heights[j * n + (i + 1) % n] - f.heights[j * n + i],
                   down = f.heights[(j + 1) % n * n + i] - f.heights[j * n + i];
      (i + 1 == n ? seam : inside) += across * across;
      (j + 1 == n ? seam : inside) += down * down;
    }
  inside /= double(2 * n * (n - 1)), seam /= double(2 * n);
  return inside > 0 ? std::sqrt(seam / inside) : seam > 0 ? INFINITY : 1.0;
}

PatchScene make_patch(const HeightField& field, Vec3 albedo) {
  const int n = field.size, side = 3 * n;
  PatchScene patch;
  Scene& s = patch.scene;
  auto h = [&](int i, int j) { return field.heights[size_t((j % n + n) % n * n + (i % n + n) % n)]; };
  const float texel = 1.0f / float(n);
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i) {
      s.positions.push_back({(float(i - n) + 0.5f) * texel, -(float(j - n) + 0.5f) * texel, h(i, j)});
      // Central differences, y against v.
      s.normals.push_back(normalize(Vec3(h(i - 1, j) - h(i + 1, j), h(i, j + 1) - h(i, j - 1), 2 * texel)));
    }
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      const uint32_t a = uint32_t(j * (side + 1) + i), b = a + 1, c = a + uint32_t(side) + 1, d = c + 1;
      s.triangles.push_back({{a, c, b}, 0, false}), s.triangles.push_back({{b, c, d}, 0, false});
    }
  Material material;
  material.name = "relief", material.base_color = albedo, material.double_sided = false;
  s.materials.push_back(material);
  Part part;
  part.name = "relief", part.vertex_count = uint32_t(s.positions.size()),
  part.triangle_count = uint32_t(s.triangles.size());
  s.parts.push_back(part);

  // The middle ones receive, and every vertex points at its like. Origins are a hair off the surface, upward: at the
  // bottom of a steep valley the normal may point into its other side.
  Receivers& r = patch.receivers;
  const float diagonal = bounds(s).diagonal();
  for (int j = n; j < 2 * n; ++j)
    for (int i = n; i < 2 * n; ++i) {
      const size_t v = size_t(j * (side + 1) + i);
      r.origins.push_back(s.positions[v] + Vec3(0, 0, 2 * receiver_lift(s.positions[v], texel, diagonal))),
          r.normals.push_back(s.normals[v]);
    }
  r.front.resize(s.positions.size());
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i) r.front[size_t(j * (side + 1) + i)] = uint32_t(j % n * n + i % n);
  r.basis = corner_receivers(s, r.front, {});
  return patch;
}

void add_floor(PatchScene& patch, float thickness) {
  Scene& s = patch.scene;
  const Bounds box = bounds(s);
  const float z = box.min.z - thickness;
  Part part;
  part.name = "floor", part.material = s.parts.front().material;
  part.first_vertex = uint32_t(s.positions.size()), part.vertex_count = 4;
  part.first_triangle = uint32_t(s.triangles.size()), part.triangle_count = 2;
  const uint32_t a = part.first_vertex, of = uint32_t(s.parts.size());
  // Beyond the walls, whatever they are.
  const Vec2 low = Vec2(box.min) - 1.0f, high = Vec2(box.max) + 1.0f;
  for (Vec2 p : {low, Vec2(low.x, high.y), high, Vec2(high.x, low.y)})
    s.positions.push_back({p, z}), s.normals.push_back({0, 0, -1});
  if (!s.colors.empty()) s.colors.resize(s.positions.size(), decltype(s.colors)::value_type(1.0f));
  for (auto& set : s.texcoords)
    if (!set.empty()) set.resize(s.positions.size());
  s.triangles.push_back({{a, a + 1, a + 2}, of, false}), s.triangles.push_back({{a, a + 2, a + 3}, of, false});
  s.parts.push_back(part);
  if (!patch.receivers.front.empty()) patch.receivers.front.resize(s.positions.size(), none);
  if (auto* corners = std::get_if<CornerReceivers>(&patch.receivers.basis))
    *corners = corner_receivers(s, patch.receivers.front, {});
  else {
    auto& texels = std::get<TexelReceivers>(patch.receivers.basis);
    texels.front.resize(s.triangles.size());
    if (!texels.back.empty()) texels.back.resize(s.triangles.size());
  }
}

Transfer view_patch(const PatchScene& patch, const Tracer& tracer, const Transfer& own, const Outgoing* outgoing,
                    int size, int views) {
  const Scene& s = patch.scene;
  const Bounds box = bounds(s);
  const float above = std::max(box.max.z, 0.0f), deep = std::max(std::abs(box.max.z), std::abs(box.min.z));
  // Sideways a ray goes one side at most.
  const float lowest = std::max(deep / std::sqrt(1 + deep * deep), 0.02f);
  const size_t rows = size_t(views) * size_t(views), n = own.columns(), channels = size_t(own.channels);
  const bool coloured = channels == 3 || outgoing;
  const size_t kept = coloured ? 3 : 1;
  WritableTransfer out = make_transfer(own.light, int(rows), int(kept), size_t(size) * size_t(size), Precision::single);
  parallel_for(out.transfer.receivers, transfer_block, [&](size_t begin, size_t end) {
    std::vector<float> values(rows * kept * n);
    std::vector<ViewWeights> weights(size_t(own.rows), ViewWeights(0, 0, 0, 1));
    for (size_t k = begin; k < end; ++k) {
      std::fill(values.begin(), values.end(), 0.0f);
      const Vec3 place((float(k % size_t(size)) + 0.5f) / float(size), -(float(k / size_t(size)) + 0.5f) / float(size),
                       0);
      for (size_t view = 0; view < rows; ++view) {
        Vec3 w = view_map_direction(views, int(view) % views, int(view) / views);
        if (w.z < lowest)
          w = Vec3(normalize_or(Vec3(w.x, w.y, 0), Vec3(1, 0, 0)) * std::sqrt(1 - lowest * lowest)) +
              Vec3(0, 0, lowest);
        const Hit hit = tracer.closest(place + w * ((above + 0.01f) / w.z), -w);
        if (hit.triangle == none) continue;
        float* row = values.data() + view * kept * n;
        const Vec3 colour = outgoing ? albedo(s, s.triangles[hit.triangle], hit.u, hit.v) : Vec3(1.0f);
        std::visit(
            [&](const auto& basis) {
              const auto* at = basis.find(hit.triangle, hit.front);
              if (!at) return;
              basis.spread(*at, hit.u, hit.v, [&](uint32_t r, float share) {
                if (outgoing) evaluate_outgoing(*outgoing, r, w, weights);
                const std::vector<float> from = load_receiver(own, r);
                for (size_t j = 0; j < weights.size(); ++j)
                  for (size_t c = 0; c < kept; ++c) {
                    const float weight = share * (weights[j][int(c)] + colour[int(c)] * weights[j].w);
                    const float* t = from.data() + (j * channels + std::min(c, channels - 1)) * n;
                    for (size_t i = 0; i < n; ++i) row[c * n + i] += weight * t[i];
                  }
              });
            },
            patch.receivers.basis);
      }
      store_receiver(out, k, values);
    }
  });
  return out.transfer;
}

Result<PatchScene> make_mesh_patch(const Scene& tile, int size, HeightField* heights) {
  constexpr size_t most_triangles = 4'000'000;
  if (size < 2 || size > 1024) return Error{"size", "must lie between 2 and 1024"};
  if (tile.triangles.size() > most_triangles) return Error{tile.path, "has more than 4,000,000 triangles to repeat"};
  const Bounds box = bounds(tile);
  const Vec3 extent = box.max - box.min;
  const float side = extent.x;
  if (!(side > 0 && std::isfinite(1 / side) && std::abs(extent.y - side) <= 0.01f * side))
    return Error{tile.path, "a patch is as wide as it is high, and this extends by " + std::to_string(extent.x) +
                                " along x and " + std::to_string(extent.y) + " along y"};
  if (!(extent.z <= 10 * side)) return Error{tile.path, "is more than ten times as deep as it is wide"};

  PatchScene patch;
  Scene& s = patch.scene;
  s.path = tile.path, s.materials = tile.materials, s.textures = tile.textures;
  const uint32_t vertices = uint32_t(tile.positions.size()), triangles = uint32_t(tile.triangles.size()),
                 parts = uint32_t(tile.parts.size());
  std::vector<Vec2> places;  // in texels, alike in all repetitions
  uint32_t copy = 0;
  for (int j = -1; j <= 1; ++j)
    for (int i = -1; i <= 1; ++i, ++copy) {
      for (Vec3 p : tile.positions) {
        const Vec3 unit((p.x - box.min.x) / side, (p.y - box.max.y) / extent.y, (p.z - box.min.z) / side);
        s.positions.push_back(unit + Vec3(float(i), float(j), 0)),
            places.push_back(Vec2(unit.x, -unit.y) * float(size));
      }
      s.normals.insert(s.normals.end(), tile.normals.begin(), tile.normals.end());
      s.colors.insert(s.colors.end(), tile.colors.begin(), tile.colors.end());
      s.texcoords.resize(tile.texcoords.size());
      for (size_t set = 0; set < tile.texcoords.size(); ++set)
        s.texcoords[set].insert(s.texcoords[set].end(), tile.texcoords[set].begin(), tile.texcoords[set].end());
      for (Triangle t : tile.triangles) {
        for (uint32_t& v : t.v) v += copy * vertices;
        t.part += copy * parts;
        s.triangles.push_back(t);
      }
      for (const Part& from : tile.parts) {
        Part part;
        part.name = from.name, part.material = from.material;
        part.first_vertex = from.first_vertex + copy * vertices, part.vertex_count = from.vertex_count;
        part.first_triangle = from.first_triangle + copy * triangles, part.triangle_count = from.triangle_count;
        s.parts.push_back(part);
      }
    }

  auto tracer = Tracer::build(s);
  if (!tracer) return tracer.error();
  Receivers& r = patch.receivers;
  const size_t count = size_t(size) * size_t(size);
  r.origins.resize(count), r.normals.resize(count), r.places.resize(count);
  std::vector<uint32_t> texels(count);
  if (heights) *heights = {size, std::vector<float>(count)};
  const float above = extent.z / side + 1, texel = 1 / float(size), diagonal = bounds(s).diagonal();
  for (size_t k = 0; k < count; ++k) {
    const size_t i = k % size_t(size), j = k / size_t(size);
    texels[k] = uint32_t(k);
    Hit hit;
    // Beside an edge where a ray slips between triangles there are triangles.
    for (int attempt = 0; attempt < 3 && hit.triangle == none; ++attempt) {
      const float off = 0.5f + 0.01f * float(attempt);
      hit = tracer->closest({(float(i) + off) * texel, -(float(j) + off) * texel, above}, {0, 0, -1});
    }
    auto where = [&] { return "texel " + std::to_string(i) + ", " + std::to_string(j) + " "; };
    if (hit.triangle == none)
      return Error{tile.path, where() + "meets no geometry from above: a patch may have no holes"};
    if (!hit.front && !s.triangles[hit.triangle].two_sided)
      return Error{tile.path, where() + "meets the back of a one-sided surface: a patch faces +z"};
    place_texel(s, r, k, {hit.triangle, hit.u, hit.v}, !hit.front, texel, diagonal);
    if (heights) heights->heights[k] = above - hit.distance;
  }
  r.basis = texel_receivers(s, size, size, places, places, std::move(texels));
  return patch;
}

}  // namespace lambent
