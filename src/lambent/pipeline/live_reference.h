#pragma once
// The path tracer behind a live picture: the same view under the same light, with ever more paths, on a thread of its
// own.
#include <lambent/pipeline/live.h>
#include <lambent/reference/path_tracer.h>

#include <memory>

namespace lambent {

class LiveReference {
 public:
  LiveReference();
  LiveReference(LiveReference&&) noexcept;
  LiveReference& operator=(LiveReference&&) noexcept;
  ~LiveReference();  // stops

  // Begins anew, with what the picture shows now; `options` say how light bounces, on what, and whether lamps shine:
  // their size, paths and seed are not looked at. Where `order` > 0 the light is its projection to so many bands. The
  // picture's scene must stay until stop().
  void start(const LivePicture& picture, const ReferenceOptions& options, int order = 0);
  // Ends what is under way, within a path a pixel's row.
  void stop();
  bool running() const;

  // The mean of all paths so far, in front of what the live picture has behind; alpha: what surfaces cover. How many
  // paths a pixel, 0: nothing yet.
  struct Seen {
    Image image;
    int paths = 0;
    std::string error;  // why there will be none
  };
  Seen seen() const;
  int paths() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Errors: none; a bake whose provenance is not known is taken for diffuse, of three bounces.
ReferenceOptions reference_options(const Baked& baked, const DrawRequest& request);

}  // namespace lambent
