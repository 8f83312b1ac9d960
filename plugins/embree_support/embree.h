// SPDX-License-Identifier: Apache-2.0
#pragma once

// Embree 3 (Debian 12) and 4 (Debian 13) behind one include: the ray query calls differ.
#if __has_include(<embree4/rtcore.h>) && !__has_include(<embree3/rtcore.h>)
#include <embree4/rtcore.h>
#define DIORAMA_EMBREE_4 1
#else
#include <embree3/rtcore.h>
#endif

#include <memory>
#include <type_traits>

namespace diorama::embree {

template <class Object, void (*kRelease)(Object)>
struct Release {
  void operator()(Object object) const { kRelease(object); }
};
template <class Object, void (*kRelease)(Object)>
using Handle = std::unique_ptr<std::remove_pointer_t<Object>, Release<Object, kRelease>>;
// Embree counts uses: a scene goes on using a geometry whose handle is gone.
using DeviceHandle = Handle<RTCDevice, &rtcReleaseDevice>;
using SceneHandle = Handle<RTCScene, &rtcReleaseScene>;
using GeometryHandle = Handle<RTCGeometry, &rtcReleaseGeometry>;

// Rays that are coherent, neighbours going nearly the same way, are traced faster when it is said.

#ifdef DIORAMA_EMBREE_4
// Trees over more than four quads that Embree 4.3 fits to moved vertices find hits where nothing
// is.
inline constexpr bool kTakesQuads = false;
using Context = RTCRayQueryContext;
inline void init(Context& context) { rtcInitRayQueryContext(&context); }
inline void intersect(RTCScene scene, Context& context, RTCRayHit& ray) {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = &context;
  rtcIntersect1(scene, &ray, &arguments);
}
inline void occluded(RTCScene scene, Context& context, RTCRay& ray) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &context;
  rtcOccluded1(scene, &ray, &arguments);
}
inline void intersect(const int* valid, RTCScene scene, Context& context, RTCRayHit8& rays,
                      bool is_coherent) {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  if (is_coherent) arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  arguments.context = &context;
  rtcIntersect8(valid, scene, &rays, &arguments);
}
inline void occluded(const int* valid, RTCScene scene, Context& context, RTCRay8& rays) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &context;
  rtcOccluded8(valid, scene, &rays, &arguments);
}
inline void occluded(const int* valid, RTCScene scene, Context& context, RTCRay16& rays) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &context;
  rtcOccluded16(valid, scene, &rays, &arguments);
}
#else
inline constexpr bool kTakesQuads = true;
using Context = RTCIntersectContext;
inline void init(Context& context) { rtcInitIntersectContext(&context); }
inline void intersect(RTCScene scene, Context& context, RTCRayHit& ray) {
  rtcIntersect1(scene, &context, &ray);
}
inline void occluded(RTCScene scene, Context& context, RTCRay& ray) {
  rtcOccluded1(scene, &context, &ray);
}
inline void intersect(const int* valid, RTCScene scene, Context& context, RTCRayHit8& rays,
                      bool is_coherent) {
  if (is_coherent) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect8(valid, scene, &context, &rays);
}
inline void occluded(const int* valid, RTCScene scene, Context& context, RTCRay8& rays) {
  rtcOccluded8(valid, scene, &context, &rays);
}
inline void occluded(const int* valid, RTCScene scene, Context& context, RTCRay16& rays) {
  rtcOccluded16(valid, scene, &context, &rays);
}
#endif

}  // namespace diorama::embree
