// Of a build without windows.
#include "window.h"

namespace lambent::tool {

Result<void> run_window(const SessionOptions&, const WindowOptions&, const Job&) {
  return Error{"--window",
               "this build has no windows: it was made without libglfw3-dev, libimgui-dev and libgl-dev; without "
               "--window the page is served to a browser"};
}

}  // namespace lambent::tool
