#pragma once
// A picture under the hand: draw(), but piece by piece and only what has changed. Light that turns asks for T . light
// and for the pixels' shades, and for no ray; a camera that moves for rays; materials for their reflection. When
// nothing is left to do, the picture is draw()'s.
#include <lambent/pipeline/draw.h>
#include <lambent/relight/products.h>

#include <memory>

namespace lambent {

// What pixels show in place of the picture.
// receivers: each in a colour; density: triangles by area; hits: the share of a receiver's rays that meet a surface;
// buried: those within something; error: as `inspect --view-error` paints it; coefficient: that column of T; rows: that
// row of T . light; balls: T of receivers here and there, by direction; lobes: their zonal lobes.
enum class Look { picture, receivers, density, hits, buried, error, coefficient, rows, balls, lobes };
inline constexpr const char* look_names = "picture|receivers|density|hits|buried|error|coefficient|rows|balls|lobes";

// Milliseconds of the latest piece of work, step by step; 0: not needed.
struct LiveTimes {
  double project = 0;  // environment -> coefficients, or the cube
  double relight = 0;  // T . light; of blocks, the product at the receivers that are seen
  double trace = 0;    // primary rays
  double shade = 0;    // O(view) at the pixels
  size_t shaded = 0;   // receivers
};

class LivePicture {
 public:
  // The request is draw()'s, and says what is seen at first. The baked file must outlive this. Errors: as draw(); what
  // cannot be shown live, by name: --frames, --indirect. With --transfer-texture the file may be a scene that was not
  // baked: a Baked with nothing but that.
  static Result<LivePicture> make(const Baked& baked, const DrawRequest& request, const Job& job = {});
  LivePicture(LivePicture&&) noexcept;
  LivePicture& operator=(LivePicture&&) noexcept;
  ~LivePicture();

  // What is shown from now on; the next work() makes what it changes. On an error all stays as it was.
  Result<void> ask(const DrawRequest& request);
  // As asked: `lambent render` with these options draws the picture that this one becomes.
  const DrawRequest& request() const;
  // `number`: of a coefficient or a row. Errors: what the file has not.
  Result<void> look_as(Look look, int number = 0);

  // One piece of work: the first sample of every pixel after a change, more of them after that. In a hurry (something
  // moves) it may make fewer pixels, a coarser light, and of blocks shade a part of what is seen, so that it takes
  // about `budget` seconds; the first call without makes up for it. False: there was nothing left to do.
  Result<bool> work(bool hurry = false, double budget = 0.03);
  bool done() const;  // all samples, of all of the light, at full size
  int samples() const;
  bool is_measuring() const;  // what the look is made of

  // What there is; radiance, with alpha where nothing is behind the scene. In a hurry its sides may be a half, a third
  // or a quarter of the view's.
  const Image& image() const;
  const View& view() const;
  // In its pose, with what is put into it (--insert, --place) where it has been drawn so; stays as it is until the
  // work() after a request of another pose or other objects.
  const Scene& scene() const;
  // The same with lamps that are not the scene's own; of others the scene itself, which scene() has.
  std::shared_ptr<const Scene> lit_scene() const;
  std::vector<std::string> lamp_names() const;  // what --lamp NAME= scales
  const Environment* environment() const;       // as loaded, not turned
  const LiveTimes& times() const;
  const Breakdown* breakdown() const;  // of blocks: what became of them in the latest shading; null of others

  // What a ray through a place of the picture meets, [0, 1]^2 from the top left.
  Hit pick(Vec2 at) const;
  // The object of --insert or --place that a triangle is of, by its number there.
  std::optional<size_t> object_of(const Hit& hit) const;

 private:
  struct State;
  explicit LivePicture(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace lambent
