// Preloaded: OpenGL says once, after a while, that the context was lost, as a driver does after a reset.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <unistd.h>

unsigned glGetError(void) {
  static unsigned (*real)(void);
  static int said;
  if (!real) real = (unsigned (*)(void))dlsym(RTLD_NEXT, "glGetError");
  const char* when = getenv("LOST_WHEN");  // a file is there
  if (!said && when && access(when, F_OK) == 0) return said = 1, 0x0507u;
  return real ? real() : 0;
}
