#pragma once
// A scene as Embree holds it: triangles in one mesh, and, where that saves memory, equal parts once.
#include <lambent/core/embree.h>
#include <lambent/core/progress.h>
#include <lambent/core/result.h>
#include <lambent/trace/tracer.h>

#include <atomic>
#include <vector>

namespace lambent {

class EmbreeScene {
 public:
  EmbreeScene() = default;
  ~EmbreeScene();
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;

  // `filters`: rays may bring a filter function in their context. Errors: out of memory; cancelled.
  Result<void> build(const Scene& source, bool filters, Sharing sharing, Progress* progress);

  RTCScene top() const { return top_; }
  size_t bytes() const { return size_t(std::max<ssize_t>(bytes_, 0)); }
  size_t copies() const { return copies_.size(); }

  // What Embree found along a ray of that direction in the world: `instance` is instID[0], `normal` Ng. No miss.
  Hit hit(unsigned instance, unsigned primitive, float u, float v, Vec3 normal, Vec3 direction, float distance) const {
    if (copies_.empty()) return {primitive, u, v, dot(normal, direction) < 0, distance};
    if (instance == RTC_INVALID_GEOMETRY_ID) return {apart_[primitive], u, v, dot(normal, direction) < 0, distance};
    const Placed& c = copies_[instance - first_copy_];
    if (c.flipped) std::swap(u, v);
    return {c.first_triangle + primitive, u, v, dot(c.normals * normal, direction) < 0, distance};
  }
  uint32_t triangle(unsigned instance, unsigned primitive) const {
    if (copies_.empty()) return primitive;
    return instance == RTC_INVALID_GEOMETRY_ID ? apart_[primitive]
                                               : copies_[instance - first_copy_].first_triangle + primitive;
  }

 private:
  struct Placed {
    uint32_t first_triangle;
    bool flipped;
    Mat3 normals;  // to the world: cofactors of the turn, which keep the side that normals are on
  };

  bool add_mesh(RTCScene scene, const Scene& source, const std::vector<uint32_t>& parts, Vec3d origin);
  bool add_copies(const Scene& source, const std::vector<struct Shape>& shapes, bool filters);

  RTCDevice device_ = nullptr;
  RTCScene top_ = nullptr;
  std::vector<RTCScene> shapes_;
  std::vector<Placed> copies_;
  unsigned first_copy_ = 0;      // its number in the top scene
  std::vector<uint32_t> apart_;  // triangles of the scene that are in no copy; empty without copies
  std::atomic<ssize_t> bytes_{0};
};

}  // namespace lambent
