#pragma once
// Which material each receiver has, for baking transfer matrices.
#include <lambent/bake/matrix.h>
#include <lambent/scene/reflection.h>

namespace lambent {

// Roughness and metallic are taken at the receiver's vertex and rounded to steps of 1/32 and 1/8, so that textures make
// a palette of materials and not one a receiver; base colour is not rounded, since responses are linear in it
// (transfer/outgoing.h).
ReceiverMaterials make_receiver_materials(const Scene& scene, const Receivers& receivers, const Reflection& reflection);

// The last reflection of incident light as it is, of kind map. Without maps when cancelled.
Outgoing make_map_outgoing(const ReceiverMaterials& materials, int incident_order, const MatrixOptions& options = {},
                           Progress* progress = nullptr);

}  // namespace lambent
