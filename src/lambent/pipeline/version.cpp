#include <lambent/pipeline/version.h>

namespace lambent {

const char* const version = LAMBENT_VERSION;

}  // namespace lambent
