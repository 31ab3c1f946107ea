#pragma once
// A small object put into a relit scene: lit, shadowed and colour-bled by the scene through its lattice of light in
// free space. The object casts neither shadow nor light on the scene, since the scene's transfer does not know it.
#include <lambent/receivers/receivers.h>
#include <lambent/relight/lattice.h>
#include <lambent/transfer/outgoing.h>

#include <optional>

namespace lambent {

// All that render() draws.
struct RelitScene {
  Scene scene;
  std::vector<uint32_t> front, back;  // as in Receivers
  size_t receivers = 0;
  Relit relit;
  std::optional<Outgoing> outgoing;  // none: diffuse
  Relit peaks = {};                  // as RenderOptions::peaks; without values: none
};

// Whether a diffuse object can be put among surfaces of that last reflection. Errors name `path`: it has no rows to
// spare for a diffuse surface (neither map nor svd), or has too many maps.
Result<void> check_insertion(const Outgoing& outgoing, const std::string& path);

// Appends a diffuse object. `transfer` is its own diffuse transfer, baked alone where it stands, of harmonics up to the
// lattice's order: each of its receivers is lit by lattice light at its place, as if it were the same all over the
// object. Errors: check_insertion()'s.
Result<void> insert_object(RelitScene& into, const Scene& object, const Receivers& receivers, const Transfer& transfer,
                           const Lattice& lattice, const Relit& light);

}  // namespace lambent
