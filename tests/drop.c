// Drops files on a window as a file manager does (XDND 5): drop WINDOW FILE...
// Fails where the window takes no drop within five seconds.
#include <X11/Xatom.h>
#include <X11/Xlib.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static Display* display;
static Atom atom(const char* name) { return XInternAtom(display, name, False); }

static void tell(Window target, const char* type, long l0, long l1, long l2, long l3, long l4) {
  XEvent e;
  memset(&e, 0, sizeof e);
  e.xclient.type = ClientMessage, e.xclient.display = display, e.xclient.window = target;
  e.xclient.message_type = atom(type), e.xclient.format = 32;
  const long data[5] = {l0, l1, l2, l3, l4};
  memcpy(e.xclient.data.l, data, sizeof data);
  XSendEvent(display, target, False, NoEventMask, &e);
  XFlush(display);
}

int main(int count, char** words) {
  display = XOpenDisplay(NULL);
  if (count < 3 || !display) return 2;
  const Window target = (Window)strtoul(words[1], NULL, 0);
  char list[8192] = "";
  for (int i = 2; i < count; ++i) {
    char here[4096];
    const int all = snprintf(here, sizeof here, "file://%s\r\n", words[i]);
    if (all < 0 || (size_t)all >= sizeof list - strlen(list)) return 2;
    strcat(list, here);
  }
  const Window source = XCreateSimpleWindow(display, DefaultRootWindow(display), 0, 0, 1, 1, 0, 0, 0);
  const Atom uris = atom("text/uri-list");
  XSetSelectionOwner(display, atom("XdndSelection"), source, CurrentTime);
  int x = 0, y = 0;
  Window child;
  XTranslateCoordinates(display, target, DefaultRootWindow(display), 20, 20, &x, &y, &child);
  tell(target, "XdndEnter", (long)source, 5L << 24, (long)uris, 0, 0);
  tell(target, "XdndPosition", (long)source, 0, (long)x << 16 | y, CurrentTime, (long)atom("XdndActionCopy"));
  const time_t start = time(NULL);
  while (time(NULL) - start < 5) {
    if (!XPending(display)) {
      usleep(10000);
      continue;
    }
    XEvent e;
    XNextEvent(display, &e);
    if (e.type == SelectionRequest) {
      const XSelectionRequestEvent* r = &e.xselectionrequest;
      XChangeProperty(display, r->requestor, r->property, r->target, 8, PropModeReplace, (unsigned char*)list,
                      (int)strlen(list));
      XEvent answer;
      memset(&answer, 0, sizeof answer);
      answer.xselection.type = SelectionNotify, answer.xselection.requestor = r->requestor;
      answer.xselection.selection = r->selection, answer.xselection.target = r->target;
      answer.xselection.property = r->property, answer.xselection.time = r->time;
      XSendEvent(display, r->requestor, False, NoEventMask, &answer);
      XFlush(display);
    }
    if (e.type != ClientMessage) continue;
    if (e.xclient.message_type == atom("XdndStatus")) {
      if (!(e.xclient.data.l[1] & 1)) return 1;
      tell(target, "XdndDrop", (long)source, 0, CurrentTime, 0, 0);
    }
    if (e.xclient.message_type == atom("XdndFinished")) return 0;
  }
  return 1;
}
