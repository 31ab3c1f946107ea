#pragma once
// What a window shows and what hands do to it, without a window: pictures, what they are compared with, actions.
#include <lambent/core/file.h>
#include <lambent/image/compare.h>
#include <lambent/light/sky.h>
#include <lambent/pipeline/live.h>
#include <lambent/pipeline/live_reference.h>

#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace lambent::tool {

// Beside the picture.
enum class Against { nothing, bake, reference, file };

struct SessionOptions {
  std::vector<std::string> baked;  // the first is shown, the others are to compare with
  std::vector<std::string> env;    // to choose from; the first lights the scene
  std::string reference;           // a picture of the same camera, to compare with; "": none
  DrawRequest draw;                // how it begins, but for `baked` and `env`
};

// How far the picture is from what it is compared with; as compare_images().
struct Distance {
  double psnr = 0, flip = -1;  // flip < 0: not measured, while either is still changing
  bool known = false;
};

class Session {
 public:
  // Errors: of files, and of what the first cannot show.
  static Result<std::unique_ptr<Session>> open(const SessionOptions& options, const Job& job);
  ~Session();

  // Of draw()'s table, by name: "exposure", "env-rotate", ... Of an option that is given again a value takes the place
  // of the one of the same name ("desk=...", "a=..." of --place, "cup.obj@..." of --insert), and with nothing after the
  // name takes it out. Errors: no such option, a wrong value; all stays.
  Result<void> set(const std::string& option, const std::string& value);
  // An option that may be given again: as if it never was.
  Result<void> clear(const std::string& option);
  // What hands do. Degrees; a share of the picture's height; a factor of the distance.
  Result<void> turn_light(float yaw, float pitch);
  Result<void> orbit(float yaw, float pitch);
  Result<void> pan(float right, float up);
  Result<void> dolly(float factor);
  Result<void> resize(int width, int height);
  Result<void> look_as(Look look, int number = 0);

  // Lamps that stand anywhere, in the order of --lamp, as text: puts `text` in the place of the one, or after the last;
  // "" takes it out. Errors: --lamp's; there is no such one; one that --move moves.
  std::vector<std::string> standing_lamps() const;
  Result<void> set_lamp(size_t index, const std::string& text);
  // A new one of a kind, "sphere", "point", "spot" or "sun", above the middle of the scene.
  std::string new_lamp(const std::string& kind) const;
  // Where in the picture it is, [0, 1]^2 from the top left; none: a sun, behind the eye, beyond the picture.
  std::optional<Vec2> lamp_in_picture(const std::string& text) const;

  // Takes hold of the lamp, or else of the object of --insert or --place, that is seen at a place of the picture,
  // [0, 1]^2 from the top left; false: none is.
  bool grab(Vec2 at);
  // The scene's material that is seen there; "": none.
  std::string material_at(Vec2 at) const;
  // Carries it there: level, at the height at which it was taken, or `lift`ed straight up and down. Errors: one that
  // --move moves.
  Result<void> carry(Vec2 at, bool lift);
  // Animations and --move: whether there are any; goes on by so many seconds, from their end to their beginning.
  bool moves_by_itself() const { return !live->request().animation.empty() || !live->request().move.empty(); }
  Result<void> advance(double seconds);
  // A file of any kind that we know: another bake takes the scene's place, an environment lights it.
  Result<void> drop(const std::string& path);
  // The file that is shown has been replaced since it was read; reads it again.
  bool is_replaced();
  Result<void> reload();
  // What is right of the wipe; of several bakes or environments the one by number.
  Result<void> compare_with(Against against, size_t bake = 1);

  void move_wipe(float at) { wipe = std::min(std::max(at, 0.0f), 1.0f), fresh_ = true; }
  void show_difference(bool on) { difference = on, fresh_ = true; }
  void show_again() { fresh_ = true; }
  bool is_fresh() const { return fresh_ && live->samples() > 0; }  // paint() has something new

  // A piece of work; false: there is nothing to do but what the path tracer does. `hurry`: hands are at it.
  Result<bool> work(bool hurry);
  bool is_measuring() const { return live->is_measuring(); }  // what a look is made of
  bool settled() const;                                       // nothing but the path tracer goes on

  // The picture as shown, left of the wipe; what it is compared with right of it, or how far both are apart. Into
  // memory for a view's pixels, which is written once and not read: eight bits a channel as the screen takes them, RGBA
  // from the top. There must be a picture.
  void paint(uint8_t* rgba);
  Image picture() const { return live->image(); }
  // Files by their endings. Errors: the disk's.
  Result<void> save(const std::string& path) const;
  // The command that draws what is seen.
  std::string command() const;

  SessionOptions options;
  std::vector<std::unique_ptr<Baked>> bakes;
  std::vector<std::string> names;  // of the bakes, as given
  std::unique_ptr<LivePicture> live, other;
  size_t shown_bake = 0, other_bake = 1;
  LiveReference reference;
  Image file;  // of options.reference
  Against against = Against::nothing;
  float wipe = 0.5f;        // of the width
  bool difference = false;  // in place of the wipe
  Look look = Look::picture;
  bool same_bands = true;  // the path tracer's light has no more bands than the bake's
  bool level = true;       // light turns about +Y alone
  Distance distance;
  Display display;            // as measured, where the exposure is automatic
  LiveTimes times;            // of the latest piece of work
  std::vector<float> frames;  // milliseconds, the latest last
  int dropped_pixels = 1;     // a side's share, in a hurry

 private:
  explicit Session(Job job) : job_(std::move(job)) {}
  Result<void> show(size_t bake);
  Result<void> ask(const DrawRequest& request);
  struct {
    enum class Of { inserted, placed, lamp } of = Of::placed;
    size_t index = 0;
    Vec3 at{0.0f};
  } held_ = {};
  Result<void> move_held(Vec3 by);
  void restart_reference();
  void measure(bool settled);
  Result<std::unique_ptr<Baked>> load(const std::string& path) const;
  FilesInMemory in_memory_;
  Job job_;
  std::filesystem::file_time_type written_ = {};
  double looked_ = 0;  // at the disk
  bool fresh_ = true, measured_ = false, light_changed_ = true;
  int seen_paths_ = 0;
  double last_exposure_ = 0;
};

// "sky:..." that gives this sky, as short as it can be.
std::string sky_text(const SkyOptions& sky);

// One action a line, as hands would: see docs/window.md. Errors: the line's number and what is wrong with it.
struct Action {
  std::string verb;
  std::vector<std::string> words;
  int line = 0;
};
Result<std::vector<Action>> parse_script(const std::string& text, const std::string& name);

}  // namespace lambent::tool
