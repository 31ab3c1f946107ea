#include "relief.h"

namespace lambent::tool {

void DisplaceOptions::add_to(CLI::App& c) {
  auto* given =
      c.add_option("--displace", heights,
                   "Move the surface by this height map, as geometry: what `render --transfer-texture` stands for");
  c.add_option("--depth", depth, "--displace: height of white over black, in sides of one repetition")
      ->needs(given)
      ->capture_default_str();
  c.add_option("--tile", tile, "--displace: U,V, its repetitions over the unit of texture coordinates")
      ->needs(given)
      ->capture_default_str();
  c.add_option("--heights", size, "--displace: texels a side that the map is taken at")
      ->needs(given)
      ->check(CLI::Range(2, 1024))
      ->capture_default_str();
}

}  // namespace lambent::tool
