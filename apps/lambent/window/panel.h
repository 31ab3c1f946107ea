#pragma once
#include "session.h"

namespace lambent::tool {

// The panel at the window's right.
struct PanelState {
  bool open = true, help = false;
  std::string notice;  // of what failed or was done, for a while
  double notice_until = 0;
  // Texts being edited.
  char env[512] = "", brdf[256] = "";
  int sky_elevation = 35, sky_azimuth = 45, coefficient = 0;
  float turbidity = 3;
  int saved = 0;
  Result<void> save(Session& session);  // under the first free name
};

void draw_panel(PanelState& panel, Session& session, float x, float width, float height);
void draw_notices(PanelState& panel, double now);

}  // namespace lambent::tool
