#pragma once
// Drawing what blocks see of a cube by Haar wavelets of the transfer: `render --method columns --terms N`.
#include <lambent/pipeline/draw.h>

namespace lambent {

// Whether a method is that one: "columns" or "columns:ERROR".
bool is_columns_method(const std::string& method);

// draw() of visibility in blocks by it: the transfer is fitted (compress/haar_fit.h) and relit by the light's largest
// terms. Diffuse, by base colour.
Result<Drawing> draw_wavelets(const Baked& baked, const DrawRequest& request, const Job& job);

}  // namespace lambent
