#pragma once
#include "session.h"

namespace lambent::tool {

// The panel at the window's right.
struct PanelState {
  bool open = true, help = false;
  std::string notice;       // of what failed or was done, for a while
  double notice_until = 0;  // below 0: for a while from when it is drawn
  // Texts being edited.
  char env[512] = "", brdf[256] = "";
  std::string material;  // that is edited
  int number = 0;        // of a coefficient or a row
  int saved = 0;
  // Milliseconds of the latest picture's way to the screen, colours and upload; and of that the upload.
  struct {
    double all = 0, upload = 0;
    bool mapped = false;
  } screen = {};
  Result<void> save(Session& session);  // under the first free name
};

// Says what went wrong; of what is done right there is nothing to say.
void tell(PanelState& panel, const Result<void>& result);
void lamp_controls(PanelState& panel, Session& session);
void paint_controls(PanelState& panel, Session& session);
void model_controls(PanelState& panel, Session& session);

void draw_panel(PanelState& panel, Session& session, float x, float width, float height);
void draw_notices(PanelState& panel, double now);

}  // namespace lambent::tool
