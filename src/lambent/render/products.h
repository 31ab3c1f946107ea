#pragma once
// What a scene gives to the shading of its receivers by products (relight/products.h), and which of them a camera may
// see.
#include <lambent/core/camera.h>
#include <lambent/receivers/receivers.h>
#include <lambent/relight/products.h>
#include <lambent/scene/reflection.h>

namespace lambent {

// Receivers at vertices, by side as in Receivers. BRDFs are taken at the vertices; what varies over the surface has one
// a receiver. The normals are those that make_vertex_receivers() gave.
ProductReceivers make_product_receivers(const Scene& scene, const std::vector<uint32_t>& front,
                                        const std::vector<uint32_t>& back, size_t count, const Reflection& reflection,
                                        const Cube& cube, const Sampling& sampling);

// Receivers of the triangles that are partly in the picture and turned towards the eye, in rising order.
std::vector<uint32_t> seen_receivers(const Scene& scene, const std::vector<uint32_t>& front,
                                     const std::vector<uint32_t>& back, size_t count, const Camera& camera, int width,
                                     int height);

}  // namespace lambent
