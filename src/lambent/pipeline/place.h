#pragma once
// Where users put rigid objects, and the paths that they take: --place and --move of a drawing.
#include <lambent/core/result.h>
#include <lambent/relight/moving.h>

#include <string>
#include <vector>

namespace lambent {

inline constexpr size_t max_placed_objects = 4096;

// Of a path: where an object is at a time, in seconds; angles as rotation_from_yaw_pitch_roll() has them.
struct PlaceKey {
  double time = 0;
  Vec3d position{0.0};
  Vec3d degrees{0.0};
};

// "NAME=FIELD@X,Y,Z[,YAW,PITCH,ROLL[,SCALE]]".
struct PlacedFile {
  std::string name, path;
  PlaceKey at;
  float scale = 1;
  std::vector<PlaceKey> keys = {};  // of its path; none: it stays
  std::string animation = "";       // of its own, by name or number; "": it is rigid
};
Result<PlacedFile> parse_place(const std::string& text);
std::string place_text(const PlacedFile& object);  // the same text again, without its path

// {"times": [...], "places": [[X, Y, Z] or [X, Y, Z, YAW, PITCH, ROLL], ...]}: seconds that rise, and as many places.
// Errors name the file.
Result<std::vector<PlaceKey>> load_path(const std::string& path);

// All of --place, --move (NAME=PATH.json), which gives one of them a path, and --pose (NAME=ANIMATION). Errors: those
// above; a name that is there twice, or not; more objects than max_placed_objects.
Result<std::vector<PlacedFile>> parse_places(const std::vector<std::string>& places,
                                             const std::vector<std::string>& moves,
                                             const std::vector<std::string>& poses = {});

// Straight from one key to the next, angles too, so that 720 degrees are two turns; before the first and after the last
// at rest. `origin` is the scene's.
RigidPlace place_at(const PlacedFile& object, double time, Vec3d origin);

}  // namespace lambent
