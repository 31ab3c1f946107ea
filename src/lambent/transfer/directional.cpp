// Follows: radiosity, "Radiosity + Normals in Half-Life 2"; McTaggart 2004 for the weights of its basis.
#include <lambent/basis/sh.h>
#include <lambent/core/check.h>
#include <lambent/transfer/directional.h>

namespace lambent {
namespace {

constexpr std::pair<DirectionalKind, const char*> names[] = {{DirectionalKind::none, "none"},
                                                             {DirectionalKind::sh2, "sh:2"},
                                                             {DirectionalKind::sh3, "sh:3"},
                                                             {DirectionalKind::hl2, "hl2"},
                                                             {DirectionalKind::vector, "vector"}};

}  // namespace

std::string directional_name(DirectionalKind kind) {
  for (const auto& [k, name] : names)
    if (k == kind) return name;
  return "";
}

std::optional<DirectionalKind> directional_kind(const std::string& text) {
  for (const auto& [kind, name] : names)
    if (text == name) return kind;
  return std::nullopt;
}

int directional_rows(DirectionalKind kind) {
  switch (kind) {
    case DirectionalKind::none: return 1;
    case DirectionalKind::sh2: return 4;
    case DirectionalKind::sh3: return 9;
    case DirectionalKind::hl2:
    case DirectionalKind::vector: return 3;
  }
  return 1;
}

Vec3 evaluate_directional_light(DirectionalKind kind, std::span<const Vec3> rows, const Mat3& frame, Vec3 n) {
  LAMBENT_CHECK(rows.size() >= size_t(directional_rows(kind)));
  Vec3 sum(0);
  switch (kind) {
    case DirectionalKind::none: return rows[0];
    case DirectionalKind::sh2:
    case DirectionalKind::sh3: return max(reconstruct_sh(rows.first(size_t(directional_rows(kind))), n), Vec3(0));
    case DirectionalKind::hl2: {
      float total = 0;
      for (int k = 0; k < 3; ++k) {
        const float cosine = std::max(0.0f, dot(n, frame * hl2_basis[k])), w = cosine * cosine;
        sum += w * rows[size_t(k)], total += w;
      }
      return total > 0 ? sum / total : Vec3(0);
    }
    case DirectionalKind::vector:
      for (int k = 0; k < 3; ++k) sum += n[k] * rows[size_t(k)];
      return max(sum, Vec3(0));
  }
  return sum;
}

void directional_weights(DirectionalKind kind, Vec3 d, const Mat3& frame, float grazing, std::span<float> out) {
  const float scale = 1 / std::max(dot(d, frame[2]), grazing);
  switch (kind) {
    case DirectionalKind::none: out[0] = 1; break;
    case DirectionalKind::sh2:
    case DirectionalKind::sh3: {
      const int order = kind == DirectionalKind::sh2 ? 2 : 3;
      evaluate_sh(order, d, out.first(size_t(sh_count(order))));
      for (int k = 0; k < sh_count(order); ++k) out[size_t(k)] *= float(clamped_cosine(sh_band(k))) * scale;
      break;
    }
    case DirectionalKind::hl2:
      for (int k = 0; k < 3; ++k) out[size_t(k)] = std::max(0.0f, dot(d, frame * hl2_basis[k])) * scale;
      break;
    case DirectionalKind::vector:
      for (int k = 0; k < 3; ++k) out[size_t(k)] = d[k] * scale;
      break;
  }
}

}  // namespace lambent
