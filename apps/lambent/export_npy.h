#pragma once
#include "terminal.h"

namespace lambent::tool {

// Pi times diffuse transfer (the cosine without 1/pi) by the input's vertices, for light in `convention`
// (sh_convert.h), and the faces, in `folder`, under the names that a convention's pipeline reads. pifu:
// bounce/bounce0.txt and bounce/face.npy; icon: bounce.npy and face.npy; others: prt.npy and faces.npy.
int export_npy(Context& context, const std::string& baked, const std::string& folder, const std::string& convention);

}  // namespace lambent::tool
