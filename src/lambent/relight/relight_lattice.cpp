#include <lambent/core/check.h>
#include <lambent/relight/lattice.h>

namespace lambent {

void interpolate_lattice(const Lattice& lattice, const Relit& relit, Vec3 position, std::span<Vec3> out) {
  LAMBENT_CHECK(out.size() >= size_t(relit.rows));
  const int n[3] = {lattice.nx, lattice.ny, lattice.nz};
  int cell[3];
  float share[3];
  for (int k = 0; k < 3; ++k) {
    const float extent = lattice.max[k] - lattice.min[k];
    const float t = extent > 0 ? std::clamp((position[k] - lattice.min[k]) / extent, 0.0f, 1.0f) * float(n[k] - 1)
                               : 0.0f;
    cell[k] = std::clamp(int(t), 0, std::max(0, n[k] - 2));
    share[k] = t - float(cell[k]);
  }
  std::fill(out.begin(), out.begin() + relit.rows, Vec3(0.0f));
  for (int corner = 0; corner < 8; ++corner) {
    float weight = 1;
    int at[3];
    for (int k = 0; k < 3; ++k) {
      const int up = corner >> k & 1;
      weight *= up ? share[k] : 1 - share[k];
      at[k] = cell[k] + up;
    }
    if (weight == 0) continue;  // also keeps the far corners of flat lattices from being read
    const size_t point = lattice.index(at[0], at[1], at[2]);
    for (int row = 0; row < relit.rows; ++row) out[size_t(row)] += weight * relit.at(point, row);
  }
}

}  // namespace lambent
