#pragma once
// Lamps that are not the scene's: named where a picture is made, moved from frame to frame, and direct light by them.
#include <lambent/core/result.h>
#include <lambent/scene/lights.h>
#include <lambent/trace/tracer.h>

#include <span>
#include <string>
#include <utility>
#include <vector>

namespace lambent {

struct MovingLamp {
  enum class Kind { sphere, point, spot, sun } kind = Kind::point;
  PunctualLight light;  // of all but spheres
  Vec3 centre{0.0f};    // of spheres
  float radius = 0;
  Vec3 radiance{0.0f};
};

// What --lamp may say of one.
inline constexpr const char* moving_lamp_syntax =
    "sphere@X,Y,Z,RADIUS=R,G,B, point@X,Y,Z=R,G,B, spot@X,Y,Z,TX,TY,TZ,ANGLE=R,G,B or "
    "sun@AZIMUTH,ELEVATION=R,G,B";

// Whether text begins as one of the four below, and is no group of the scene's own.
bool names_moving_lamp(const std::string& text);

// sphere@X,Y,Z,RADIUS=R,G,B (radiance), point@X,Y,Z=R,G,B (flux per steradian), spot@X,Y,Z,TX,TY,TZ,ANGLE=R,G,B (the
// same, within ANGLE degrees of the way to the target T, full within half of that), sun@AZIMUTH,ELEVATION=R,G,B
// (irradiance; degrees, azimuth from +X towards +Z as of skies). One number stands for three alike. Places are in the
// file's space. Errors name --lamp.
Result<MovingLamp> parse_moving_lamp(const std::string& text, Vec3d origin = Vec3d(0));
// The same as its numbers, in the file's space and in the order of the text: for who changes some of them. Whether they
// are within their ranges parse_moving_lamp() says.
struct LampNumbers {
  MovingLamp::Kind kind = MovingLamp::Kind::point;
  std::vector<double> numbers;
  Vec3 color{1.0f};
};
Result<LampNumbers> read_lamp_numbers(const std::string& text);
std::string lamp_text(const LampNumbers& lamp);
// By an offset, a spot's target with it; suns have no place.
void carry_lamp(LampNumbers& lamp, Vec3d by);

// Whether both give the same light.
bool is_same(const MovingLamp& a, const MovingLamp& b);

Result<std::vector<MovingLamp>> parse_moving_lamps(const std::vector<std::string>& texts, Vec3d origin = Vec3d(0));

// Where a lamp is when: N@T:X,Y,Z;T:X,Y,Z;..., lamp N (from 1) at rising times, straight from place to place, and
// standing before the first and after the last. Spots keep their direction. Errors name --move.
struct LampPath {
  size_t lamp = 0;
  std::vector<std::pair<double, Vec3>> places;
};
Result<LampPath> parse_lamp_path(const std::string& text, const std::vector<MovingLamp>& lamps,
                                 Vec3d origin = Vec3d(0));
void move_lamp(std::vector<MovingLamp>& lamps, const LampPath& path, double time);

// The same of a lamp of distant light, which stands in a direction: N@AZIMUTH,ELEVATION (degrees, as of suns), or
// N@T:AZIMUTH,ELEVATION;..., along the shorter arc from one to the next. `lamps`: how many there are.
struct LampArc {
  size_t lamp = 0;
  std::vector<std::pair<double, Vec3>> places;
};
Result<LampArc> parse_lamp_arc(const std::string& text, size_t lamps);
Vec3 direction_at(const LampArc& arc, double time);

// Exit radiance of a white surface at `origin`, which is clear of it, by direct light of the lamps. Spheres are sampled
// by solid angle, `samples` times each, by numbers keyed by `key`; a place within a sphere has no light of it.
Vec3 direct_light(const Tracer& tracer, std::span<const MovingLamp> lamps, Vec3 origin, Vec3 normal, int samples,
                  uint64_t key);
// That of lamp k of them is of hash64(key, k) alone.
Vec3 direct_light(const Tracer& tracer, const MovingLamp& lamp, Vec3 origin, Vec3 normal, int samples, uint64_t key);

// The same with nothing in the way; of a sphere, about.
Vec3 clear_light(const MovingLamp& lamp, Vec3 origin, Vec3 normal);

// The same lamps as the scene's own: punctual lights, and spheres as surfaces that glow and reflect nothing.
void add_lamps(Scene& scene, const std::vector<MovingLamp>& lamps);

}  // namespace lambent
