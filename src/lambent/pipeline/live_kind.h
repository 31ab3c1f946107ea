#pragma once
// A kind of live picture whose light and shades are steps of its own: direct to indirect light, transfer textures.
#include <lambent/pipeline/draw_light.h>
#include <lambent/pipeline/live.h>
#include <lambent/render/render.h>

#include <array>
#include <utility>

namespace lambent {

// The environment as it is and coarse, of light that turns; null: none.
struct LiveSkies {
  std::array<std::shared_ptr<const Environment>, 2> env = {};
  std::array<std::shared_ptr<const KnownHarmonics>, 2> known = {};
  Mat3 turn{1.0f};
};

class LiveKind {
 public:
  // `baked` must outlive it.
  LiveKind(const Baked& baked, const DrawRequest& request, const Job& job)
      : baked_(baked), request_(request), job_(job) {}
  virtual ~LiveKind() = default;

  // What a request makes anew.
  struct Due {
    bool light = false, rays = false, shades = false;
  };
  // What is shown from now on, under these skies. On an error all stays as it was.
  Result<Due> ask(const DrawRequest& request, const LiveSkies& skies) {
    const DrawRequest before = std::exchange(request_, request);
    const LiveSkies old = std::exchange(skies_, skies);
    Due due;
    auto made = change(before, due);
    if (made) return due;
    request_ = before, skies_ = old;
    Due again;
    restore_sky();
    (void)change(request, again);
    return made.error();
  }

  virtual const Scene& scene() const = 0;
  virtual const Tracer& tracer() const = 0;
  // With lamps that are not the scene's; null: the scene.
  virtual std::shared_ptr<const Scene> lit_scene() const { return nullptr; }
  virtual std::vector<std::string> lamp_names() const { return {}; }

  // unfinished: nothing to show yet; partial: to go on with at once; draft: to be made again when nothing moves.
  enum class Light { unfinished, partial, draft, whole };
  // A piece of work of about `budget` seconds.
  virtual Result<Light> light(bool hurry, double budget, LiveTimes& times) = 0;

  // Radiance of what the rays of a pass met, by number; what they are is the same as before unless rays were due.
  struct Pass {
    const ViewRays& rays;
    int sample = 0, scale = 1;
    bool fresh = false;  // other rays than last time
    bool hurry = false;
    Vec3 eye{0.0f};
  };
  virtual std::function<RayShade()> shade(const Pass& pass) = 0;
  virtual bool shades_coarsely() const { return false; }  // in a hurry

 protected:
  // To request_ and skies_, from what was asked for before.
  virtual Result<void> change(const DrawRequest& before, Due& due) = 0;
  virtual void restore_sky() {}  // of which more may be kept than skies_

  const Baked& baked_;
  DrawRequest request_;
  Job job_;
  LiveSkies skies_ = {};
};

// A kind by its begin(skies).
template <class Kind>
Result<std::unique_ptr<LiveKind>> make_live(const Baked& baked, const DrawRequest& request, const LiveSkies& skies,
                                            const Job& job) {
  auto made = std::make_unique<Kind>(baked, request, job);
  if (auto ok = made->begin(skies); !ok) return ok.error();
  return std::unique_ptr<LiveKind>(std::move(made));
}

// `baked` must outlive it. Errors: as draw().
Result<std::unique_ptr<LiveKind>> make_live_indirect(const Baked& baked, const DrawRequest& request,
                                                     const LiveSkies& skies, const Job& job);
Result<std::unique_ptr<LiveKind>> make_live_texture(const Baked& baked, const DrawRequest& request,
                                                    const LiveSkies& skies, const Job& job);

}  // namespace lambent
