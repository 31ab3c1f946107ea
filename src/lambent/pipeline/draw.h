#pragma once
// ONE drawing, whatever the kind: O(view) . T . light. Light becomes columns (or, for blocks, a cube), a Relighter
// makes rows of them, and what those rows mean says how they are shaded. The command line and whoever else only fill
// the request in.
#include <lambent/pipeline/bake.h>
#include <lambent/pipeline/draw_request.h>

namespace lambent {

struct Drawing {
  std::vector<Image> frames;  // one a pose; radiance
  Summary summary;
};

// `baked` is what request.baked names. Errors: those of check_draw(), of the little syntaxes (parse.h), of files, of
// the stages; cancelled.
Result<Drawing> draw(const Baked& baked, const DrawRequest& request, const Job& job = {});

// Reads request.baked first; with request.transfer_texture it may be any scene.
Result<Drawing> draw(const DrawRequest& request, const Job& job = {});

// And writes request.output, frames side by side.
Result<Summary> draw_to_file(const DrawRequest& request, const Job& job = {});

// The last reflection of a bake that kept incident light, for other materials. Errors: any other bake.
Result<Outgoing> change_materials(const Baked& baked, const Reflection& reflection);

}  // namespace lambent
