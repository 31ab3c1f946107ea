#pragma once
// Which extensions of glTF are read, and what it means for the picture where one is not.
#include <nlohmann/json.hpp>

#include <string>
#include <vector>

namespace lambent {

// Whether a file may require it. Materials' extensions all may: the surface is there without them, and a warning says
// what it lacks.
bool is_supported_extension(const std::string& name);

// One line for each extension that stands on an object of the document, is not read and may change the picture; one for
// all that are not known here. Silent: those that are read, and those that change no picture. Names that are only
// listed as used change nothing.
void warn_of_unread_extensions(const nlohmann::json& document, std::vector<std::string>& warnings);

// Takes textures whose only image is of a kind that is not read (KTX2, AVIF, DDS) out of the materials, for good: a
// viewer of what is written would fail at them. Emission and transmission that such a texture shapes go with it: a lamp
// of unknown pattern gives no light.
void drop_unread_textures(nlohmann::json& document, std::vector<std::string>& warnings);

// An extension of an object; null where it has none of the name.
const nlohmann::json* find_extension(const nlohmann::json& holder, const char* name);
// Takes an extension from an object, and with it an object of extensions that holds no other. Null where it is not
// there.
nlohmann::json take_extension(nlohmann::json& holder, const char* name);
// Whether any object of a document has it.
bool uses_extension(const nlohmann::json& value, const char* name);
// Takes a name from the lists of extensions used and required, if no object has it.
void drop_extension_name(nlohmann::json& document, const char* name);

}  // namespace lambent
