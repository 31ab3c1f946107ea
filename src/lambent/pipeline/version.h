#pragma once

namespace lambent {

extern const char* const version;  // "0.1.0", of the project

}  // namespace lambent
