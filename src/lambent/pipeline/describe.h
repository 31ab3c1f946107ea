#pragma once
// What a field is, said: for people in a line or two, for programs as JSON.
#include <lambent/transfer/field.h>

#include <nlohmann/json.hpp>

#include <string>

namespace lambent {

// One word each, beside name_of(store): "vertices", "texels", "patches", "lattice", "view"; "diffuse", "directional",
// "outgoing", "incident", "pixels", "sight".
const char* name_of(const Placement& where);
const char* name_of(const Rows& rows);

// {"kind", "store", "where", "meaning", "receivers", "bytes", ...}, and what the store, the rows and the placement have
// to say for themselves. "kind" is that of the file (docs/file-format.md).
nlohmann::json describe(const Field& field);

// "diffuse, order 6, 36 columns, 1 row, 3 channels, 1,234 receivers, 1.2 MB (half)", and a line for each further thing.
std::string describe_in_words(const Field& field);

}  // namespace lambent
