#pragma once
// What differs between Embree 3.13 and Embree 4 for those two that trace by it: the pipeline (trace/) and the path
// tracer (reference/), which share no more than these calls. Not for other headers.
#ifdef LAMBENT_EMBREE4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <algorithm>
#include <cstddef>

namespace lambent::embree {

// What goes with rays. A filter is asked at every hit, in scenes with the flag `filtered`; its args->context points to
// the query's first member, and so to the query, and to whatever has the query as ITS first member.
#if RTC_VERSION_MAJOR >= 4
inline constexpr RTCSceneFlags filtered = RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;
struct Query {
  RTCRayQueryContext context;
  RTCFilterFunctionN filter = nullptr;
  Query() { rtcInitRayQueryContext(&context); }
};

template <class Arguments>
void fill(Arguments& arguments, Query& query) {
  arguments.context = &query.context, arguments.filter = query.filter;
  if (query.filter) arguments.flags = RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
}
inline RTCIntersectArguments intersect_arguments(Query& query) {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  fill(arguments, query);
  return arguments;
}
inline RTCOccludedArguments occluded_arguments(Query& query) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  fill(arguments, query);
  return arguments;
}

inline void intersect1(RTCScene scene, Query& query, RTCRayHit& ray) {
  RTCIntersectArguments arguments = intersect_arguments(query);
  rtcIntersect1(scene, &ray, &arguments);
}
inline void intersect16(const int* valid, RTCScene scene, Query& query, RTCRayHit16& rays) {
  RTCIntersectArguments arguments = intersect_arguments(query);
  rtcIntersect16(valid, scene, &rays, &arguments);
}
inline void occluded1(RTCScene scene, Query& query, RTCRay& ray) {
  RTCOccludedArguments arguments = occluded_arguments(query);
  rtcOccluded1(scene, &ray, &arguments);
}
inline void occluded16(const int* valid, RTCScene scene, Query& query, RTCRay16& rays) {
  RTCOccludedArguments arguments = occluded_arguments(query);
  rtcOccluded16(valid, scene, &rays, &arguments);
}
// Streams are gone from Embree 4: packets of sixteen.
inline void occluded_many(RTCScene scene, Query& query, RTCRay* rays, size_t count) {
  alignas(64) int valid[16];
  RTCRay16 packet;
  for (size_t begin = 0; begin < count; begin += 16) {
    const size_t n = std::min<size_t>(16, count - begin);
    for (size_t i = 0; i < 16; ++i) {
      const RTCRay& r = rays[begin + std::min(i, n - 1)];
      valid[i] = i < n ? -1 : 0;
      packet.org_x[i] = r.org_x, packet.org_y[i] = r.org_y, packet.org_z[i] = r.org_z, packet.tnear[i] = r.tnear;
      packet.dir_x[i] = r.dir_x, packet.dir_y[i] = r.dir_y, packet.dir_z[i] = r.dir_z, packet.time[i] = r.time;
      packet.tfar[i] = r.tfar, packet.mask[i] = r.mask, packet.id[i] = r.id, packet.flags[i] = r.flags;
    }
    occluded16(valid, scene, query, packet);
    for (size_t i = 0; i < n; ++i) rays[begin + i].tfar = packet.tfar[i];
  }
}
inline void intersect_many(RTCScene scene, Query& query, RTCRayHit* rays, size_t count) {
  for (size_t i = 0; i < count; ++i) intersect1(scene, query, rays[i]);
}
#else
inline constexpr RTCSceneFlags filtered = RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION;
struct Query {
  RTCIntersectContext context;
  RTCFilterFunctionN filter = nullptr;
  Query() { rtcInitIntersectContext(&context); }
  RTCIntersectContext* ready() {
    context.filter = filter;
    return &context;
  }
};

inline void intersect1(RTCScene scene, Query& query, RTCRayHit& ray) { rtcIntersect1(scene, query.ready(), &ray); }
inline void intersect16(const int* valid, RTCScene scene, Query& query, RTCRayHit16& rays) {
  rtcIntersect16(valid, scene, query.ready(), &rays);
}
inline void occluded1(RTCScene scene, Query& query, RTCRay& ray) { rtcOccluded1(scene, query.ready(), &ray); }
inline void occluded16(const int* valid, RTCScene scene, Query& query, RTCRay16& rays) {
  rtcOccluded16(valid, scene, query.ready(), &rays);
}
inline void occluded_many(RTCScene scene, Query& query, RTCRay* rays, size_t count) {
  rtcOccluded1M(scene, query.ready(), rays, unsigned(count), sizeof(RTCRay));
}
inline void intersect_many(RTCScene scene, Query& query, RTCRayHit* rays, size_t count) {
  rtcIntersect1M(scene, query.ready(), rays, unsigned(count), sizeof(RTCRayHit));
}
#endif

}  // namespace lambent::embree
