// The window: GLFW for input, OpenGL for one textured rectangle, Dear ImGui for the panel. What is shown is computed by
// the session; nothing of the picture depends on the graphics card.
#include "window.h"

#include "film.h"
#include "panel.h"
#include "upload.h"

#include <lambent/core/file.h>
#include <lambent/core/clock.h>

// clang-format off
#include <GLFW/glfw3.h>
// clang-format on
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace lambent::tool {
namespace {

double window_clock() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

constexpr float panel_width = 320;
constexpr double rest = 0.15;  // seconds after which hands are thought to rest

struct Window {
  Session& session;
  const WindowOptions& options;
  const Job& job;
  GLFWwindow* handle = nullptr;
  PictureUpload upload = {};
  PanelState panel = {};
  std::vector<std::string> dropped = {};
  std::vector<int> pressed = {};  // keys, since the last frame
  // Of a drag under way.
  enum class Drag { none, look, light, pan, wipe, object } drag = Drag::none;
  double x = 0, y = 0, last_input = 0;
  double last_click = 0, click_x = 0, click_y = 0;
  double played = -1;  // what moves by itself goes on since then; below 0: it stands
  int frames_due = 3;  // Dear ImGui settles in a few
  // Of the script.
  std::vector<Action> script = {};
  size_t next = 0;
  int frames_left = 0;
  double wait_until = 0;
  bool stays = false;

  Vec2 place_of(double at_x, double at_y) const {  // in the picture
    int height = 1;
    glfwGetWindowSize(handle, nullptr, &height);
    return Vec2(float(at_x) / float(picture_width()), float(at_y) / float(std::max(1, height)));
  }
  int picture_width() const {
    int width = 0, height = 0;
    glfwGetFramebufferSize(handle, &width, &height);
    return std::max(1, width - (panel.open ? int(panel_width) : 0));
  }
  void say(const Result<void>& result) {
    if (!result) panel.notice = result.error().text(), panel.notice_until = window_clock() + 6;
    last_input = window_clock(), frames_due = 3;
  }
};

std::string glfw_problem;
void keep_problem(int, const char* text) { glfw_problem = text ? text : ""; }

Window& of(GLFWwindow* handle) { return *static_cast<Window*>(glfwGetWindowUserPointer(handle)); }

void on_button(GLFWwindow* handle, int button, int action, int mods) {
  Window& w = of(handle);
  w.frames_due = 3;
  if (action == GLFW_RELEASE) {
    w.drag = Window::Drag::none;
    return;
  }
  if (ImGui::GetIO().WantCaptureMouse) return;
  glfwGetCursorPos(handle, &w.x, &w.y);
  const bool at_wipe = w.session.against != Against::nothing && !w.session.difference &&
                       std::abs(w.x - double(w.session.wipe) * w.picture_width()) < 6;
  if (mods & GLFW_MOD_CONTROL && button == GLFW_MOUSE_BUTTON_LEFT) {
    if (w.session.grab(w.place_of(w.x, w.y))) w.drag = Window::Drag::object;
    else w.say(Error{"nothing to carry", "no lamp that stands anywhere and no object of --insert or --place is there"});
    return;
  }
  if (const double now = window_clock(); button == GLFW_MOUSE_BUTTON_LEFT) {
    const bool twice = now - w.last_click < 0.35 && std::hypot(w.x - w.click_x, w.y - w.click_y) < 4;
    w.last_click = now, w.click_x = w.x, w.click_y = w.y;
    if (twice) w.panel.material = w.session.material_at(w.place_of(w.x, w.y));
  }
  w.drag = at_wipe                                                      ? Window::Drag::wipe
         : button == GLFW_MOUSE_BUTTON_RIGHT || (mods & GLFW_MOD_SHIFT) ? Window::Drag::light
         : button == GLFW_MOUSE_BUTTON_MIDDLE || (mods & GLFW_MOD_ALT)  ? Window::Drag::pan
                                                                        : Window::Drag::look;
}

void on_move(GLFWwindow* handle, double x, double y) {
  Window& w = of(handle);
  w.frames_due = 3;
  const float dx = float(x - w.x), dy = float(y - w.y);
  w.x = x, w.y = y;
  if (w.drag == Window::Drag::none || (dx == 0 && dy == 0)) return;
  int height = 1, width = w.picture_width();
  glfwGetWindowSize(handle, nullptr, &height);
  const float degrees_a_pixel = 180.0f / float(std::max(1, height));
  switch (w.drag) {
    case Window::Drag::look: return w.say(w.session.orbit(-degrees_a_pixel * dx, degrees_a_pixel * dy));
    case Window::Drag::light: return w.say(w.session.turn_light(-degrees_a_pixel * dx, degrees_a_pixel * dy));
    case Window::Drag::pan: return w.say(w.session.pan(dx / float(height), dy / float(height)));
    case Window::Drag::wipe: return w.session.move_wipe(float(x) / float(width)), w.say({});
    case Window::Drag::object:
      return w.say(w.session.carry(w.place_of(x, y), glfwGetKey(handle, GLFW_KEY_LEFT_SHIFT) == GLFW_PRESS));
    case Window::Drag::none: return;
  }
}

void on_scroll(GLFWwindow* handle, double, double dy) {
  Window& w = of(handle);
  if (!ImGui::GetIO().WantCaptureMouse) w.say(w.session.dolly(std::pow(0.9f, float(dy))));
  w.frames_due = 3;
}

void on_key(GLFWwindow* handle, int key, int, int action, int mods) {
  Window& w = of(handle);
  w.frames_due = 3;
  if (action == GLFW_PRESS && key >= 0) w.pressed.push_back(key);
  if (action == GLFW_RELEASE || ImGui::GetIO().WantTextInput) return;
  const bool light = mods & GLFW_MOD_SHIFT;
  auto turn = [&](float yaw, float pitch) {
    w.say(light ? w.session.turn_light(yaw, -pitch) : w.session.orbit(yaw, pitch));
  };
  switch (key) {
    case GLFW_KEY_LEFT: return turn(-5, 0);
    case GLFW_KEY_RIGHT: return turn(5, 0);
    case GLFW_KEY_UP: return turn(0, 5);
    case GLFW_KEY_DOWN: return turn(0, -5);
    case GLFW_KEY_EQUAL:
    case GLFW_KEY_KP_ADD: return w.say(w.session.dolly(0.9f));
    case GLFW_KEY_MINUS:
    case GLFW_KEY_KP_SUBTRACT: return w.say(w.session.dolly(1 / 0.9f));
    case GLFW_KEY_TAB: w.panel.open = !w.panel.open; return;
    case GLFW_KEY_D: return w.session.show_difference(!w.session.difference), w.say({});
    case GLFW_KEY_R:
      return w.say(
          w.session.compare_with(w.session.against == Against::reference ? Against::nothing : Against::reference));
    case GLFW_KEY_S:
      if (auto ok = w.panel.save(w.session); !ok) w.say(ok);
      return;
    case GLFW_KEY_F5: return w.say(w.session.reload());
    case GLFW_KEY_SPACE: w.played = w.session.moves_by_itself() && w.played < 0 ? window_clock() : -1; return;
    case GLFW_KEY_F1: w.panel.help = !w.panel.help; return;
    case GLFW_KEY_ESCAPE: w.panel.help = false; return;
    case GLFW_KEY_Q:
      if (mods & GLFW_MOD_CONTROL) glfwSetWindowShouldClose(handle, 1);
      return;
    default: return;
  }
}

void on_drop(GLFWwindow* handle, int count, const char** paths) {
  for (int i = 0; i < count; ++i) of(handle).dropped.emplace_back(paths[i]);
}

void on_refresh(GLFWwindow* handle) { of(handle).frames_due = 3; }
void on_resize(GLFWwindow* handle, int, int) { of(handle).frames_due = 3, of(handle).last_input = window_clock(); }

Result<void> make_window(Window& w) {
  auto size = parse_size(w.options.size, "--size");
  if (!size) return size.error();
  glfwSetErrorCallback(keep_problem);
  if (!glfwInit())
    return Error{"--window", "there is no display to open a window on (" + glfw_problem +
                                 "); without --window the "
                                 "page is served to a browser"};
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3), glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_CONTEXT_ROBUSTNESS, GLFW_LOSE_CONTEXT_ON_RESET);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE), glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, 1);
  w.handle =
      glfwCreateWindow((*size)[0], (*size)[1], ("lambent: " + w.session.names.front()).c_str(), nullptr, nullptr);
  if (!w.handle) return Error{"--window", "OpenGL 3.3 is not to be had here: " + glfw_problem};
  glfwMakeContextCurrent(w.handle);
  glfwSwapInterval(1);
  glfwSetWindowUserPointer(w.handle, &w);
  glfwSetMouseButtonCallback(w.handle, on_button), glfwSetCursorPosCallback(w.handle, on_move);
  glfwSetScrollCallback(w.handle, on_scroll), glfwSetKeyCallback(w.handle, on_key);
  glfwSetDropCallback(w.handle, on_drop), glfwSetWindowRefreshCallback(w.handle, on_refresh);
  glfwSetFramebufferSizeCallback(w.handle, on_resize);
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  ImGui::GetIO().IniFilename = nullptr;  // nothing is left behind
  if (!ImGui_ImplGlfw_InitForOpenGL(w.handle, true) || !ImGui_ImplOpenGL3_Init("#version 330 core"))
    return Error{"--window", "OpenGL 3.3 is not to be had here"};
  w.upload.open(), w.session.show_again();
  return {};
}

void close_window(Window& w) {
  if (w.upload.texture()) w.upload.close();
  if (ImGui::GetCurrentContext()) {
    if (ImGui::GetIO().BackendRendererUserData) ImGui_ImplOpenGL3_Shutdown();
    if (ImGui::GetIO().BackendPlatformUserData) ImGui_ImplGlfw_Shutdown();
    ImGui::DestroyContext();
  }
  if (w.handle) glfwDestroyWindow(w.handle);
  w.handle = nullptr;
  glfwTerminate();
}

// After a context that was lost: another window at the same place.
Result<void> reopen(Window& w) {
  int width = 0, height = 0, x = 0, y = 0;
  glfwGetWindowSize(w.handle, &width, &height), glfwGetWindowPos(w.handle, &x, &y);
  close_window(w);
  if (auto ok = make_window(w); !ok) return ok;
  glfwSetWindowSize(w.handle, width, height), glfwSetWindowPos(w.handle, x, y);
  w.frames_due = 3, w.drag = Window::Drag::none;
  return {};
}

bool is_lost() {
  constexpr GLenum context_lost = 0x0507;
  return glGetError() == context_lost;
}

// Rings where lamps stand that have a place.
void draw_lamps(const Window& w, float height) {
  const std::vector<std::string> lamps = w.session.standing_lamps();
  ImDrawList& list = *ImGui::GetBackgroundDrawList();
  for (size_t i = 0; i < lamps.size(); ++i)
    if (const auto at = w.session.lamp_in_picture(lamps[i])) {
      const ImVec2 place(at->x * float(w.picture_width()), at->y * height);
      list.AddCircle(place, 10, IM_COL32(0, 0, 0, 200), 0, 3.5f),
          list.AddCircle(place, 10, IM_COL32(255, 210, 90, 255), 0, 1.5f);
      const std::string number = fmt::format("{}", i + 1);
      for (const float beside : {-1.0f, 1.0f})
        list.AddText(ImVec2(place.x + 14 + beside, place.y - 6 + beside), IM_COL32(0, 0, 0, 255), number.c_str());
      list.AddText(ImVec2(place.x + 14, place.y - 6), IM_COL32(255, 210, 90, 255), number.c_str());
    }
}

void present(Window& w) {
  int width = 0, height = 0;
  glfwGetFramebufferSize(w.handle, &width, &height);
  if (w.session.is_fresh()) {
    const double start = window_clock();
    const View& view = w.session.live->view();
    w.session.paint(w.upload.begin(view.width, view.height)), w.upload.end();
    w.panel.screen = {1e3 * (window_clock() - start), w.upload.milliseconds(), w.upload.is_mapped()};
  }
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  for (int key : w.pressed) ImGui::GetIO().KeysDown[key] = true;  // also what was let go since
  ImGui::NewFrame();
  for (int key : std::exchange(w.pressed, {})) ImGui::GetIO().KeysDown[key] = glfwGetKey(w.handle, key) == GLFW_PRESS;
  if (w.panel.screen.all > 0)
    ImGui::GetBackgroundDrawList()->AddImage(reinterpret_cast<void*>(uintptr_t(w.upload.texture())), ImVec2(0, 0),
                                             ImVec2(float(w.picture_width()), float(height)));
  if (w.panel.open) draw_lamps(w, float(height));
  if (w.panel.open) draw_panel(w.panel, w.session, float(w.picture_width()), panel_width, float(height));
  draw_notices(w.panel, window_clock());
  ImGui::Render();
  glViewport(0, 0, width, height);
  glClearColor(0.1f, 0.1f, 0.1f, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
}

Result<void> screenshot(Window& w, const std::string& path) {
  present(w);
  int width = 0, height = 0;
  glfwGetFramebufferSize(w.handle, &width, &height);
  std::vector<uint8_t> pixels(size_t(width) * size_t(height) * 3);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, pixels.data());
  Image image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c)
        image.at(x, height - 1 - y)[c] =
            srgb_decode(float(pixels[3 * (size_t(y) * size_t(width) + size_t(x)) + size_t(c)]) / 255);
  if (auto ok = check_output(path, {"png"}); !ok) return ok;
  return save_image(path, image);
}

Result<float> number(const std::string& text, const char* verb) {
  auto n = parse_numbers(text, 1, verb);
  if (!n) return n.error();
  return (*n)[0];
}

Result<void> two_numbers(const Action& a, const std::function<Result<void>(float, float)>& run) {
  auto x = number(a.words[0], a.verb.c_str());
  if (!x) return x.error();
  auto y = a.words.size() > 1 ? number(a.words[1], a.verb.c_str()) : Result<float>(0.0f);
  if (!y) return y.error();
  return run(*x, *y);
}

Result<void> act(Window& w, const Action& a) {
  Session& s = w.session;
  w.last_input = window_clock();
  const std::string& word = a.words.empty() ? a.verb : a.words[0];
  if (a.verb == "set") return s.set(word, a.words[1]);
  if (a.verb == "turn-light") return two_numbers(a, [&](float x, float y) { return s.turn_light(x, y); });
  if (a.verb == "orbit") return two_numbers(a, [&](float x, float y) { return s.orbit(x, y); });
  if (a.verb == "pan") return two_numbers(a, [&](float x, float y) { return s.pan(x, y); });
  if (a.verb == "dolly") return two_numbers(a, [&](float x, float) { return s.dolly(x); });
  if (a.verb == "look") {
    const std::vector<std::string> looks = choices_of(look_names);
    if (const auto look = std::find(looks.begin(), looks.end(), word); look != looks.end())
      return two_numbers({a.verb, {a.words.size() > 1 ? a.words[1] : "0"}, a.line},
                         [&](float k, float) { return s.look_as(Look(look - looks.begin()), int(k)); });
    return Error{"look", std::string("must be one of ") + look_names, true};
  }
  if (a.verb == "compare") {
    if (word == "nothing") return s.compare_with(Against::nothing);
    if (word == "reference") return s.compare_with(Against::reference);
    if (word == "file") return s.compare_with(Against::file);
    if (word == "bake")
      return two_numbers({a.verb, {a.words.size() > 1 ? a.words[1] : "1"}, a.line},
                         [&](float k, float) { return s.compare_with(Against::bake, size_t(std::max(0.0f, k))); });
    return Error{"compare", "must be nothing, bake, reference or file", true};
  }
  if (a.verb == "wipe") return two_numbers(a, [&](float x, float) { return s.move_wipe(x), Result<void>(); });
  if (a.verb == "difference") return s.show_difference(word == "on"), Result<void>();
  if (a.verb == "drop") return s.drop(word);
  if (a.verb == "reload") return s.reload();
  if (a.verb == "reopen") return reopen(w);
  if (a.verb == "lamp")
    return two_numbers({a.verb, {word}, a.line}, [&](float k, float) {
      if (!(k >= 1)) return Result<void>(Error{"lamp", "counts from 1", true});
      return s.set_lamp(size_t(k) - 1, a.words.size() > 1 ? a.words[1] : "");
    });
  if (a.verb == "settle") return settle(s, w.job);
  if (a.verb == "wait")
    return two_numbers(a, [&](float x, float) { return w.wait_until = window_clock() + double(x), Result<void>(); });
  if (a.verb == "frames") return two_numbers(a, [&](float x, float) { return w.frames_left = int(x), Result<void>(); });
  if (a.verb == "save") return s.save(word);
  if (a.verb == "screenshot") return screenshot(w, word);
  if (a.verb == "film") {
    auto count = number(a.words[1], "film");
    if (!count || !(*count >= 1 && *count <= 10000)) return Error{"film", "wants 1 to 10000 pictures", true};
    return film(s, word, int(*count), a.words[2], w.job);
  }
  if (a.verb == "size") {
    auto size = parse_size(word, "size");
    if (!size) return size.error();
    glfwSetWindowSize(w.handle, (*size)[0] + (w.panel.open ? int(panel_width) : 0), (*size)[1]);
    for (int i = 0; i < 100 && w.picture_width() != (*size)[0]; ++i) glfwWaitEventsTimeout(0.02);
    return s.resize((*size)[0], (*size)[1]);
  }
  if (a.verb == "panel") return w.panel.open = word != "off", Result<void>();
  return w.stays = true, Result<void>();
}

// What the script asks for next; false: it has ended.
Result<bool> run_script(Window& w) {
  if (w.frames_left > 0) return --w.frames_left, true;
  if (window_clock() < w.wait_until) return true;
  if (w.next >= w.script.size()) return w.script.empty() || w.stays;
  const Action& a = w.script[w.next++];
  w.frames_due = 3;
  if (auto ok = act(w, a); !ok)
    return Error{fmt::format("{}: line {}", w.options.script, a.line), ok.error().text(), ok.error().usage};
  return true;
}

Result<void> loop(Window& w) {
  bool busy = true;
  while (!glfwWindowShouldClose(w.handle) && !is_cancelled(w.job.progress)) {
    const bool traces = w.session.against == Against::reference;
    const bool scripted = w.next < w.script.size() || w.frames_left > 0;
    if (busy || scripted || w.played >= 0 || w.frames_due > 0 || !w.dropped.empty()) glfwPollEvents();
    else glfwWaitEventsTimeout(traces ? 0.2 : 1.0);
    for (const std::string& path : std::exchange(w.dropped, {})) w.say(w.session.drop(path));
    int width = 0, height = 0;
    glfwGetFramebufferSize(w.handle, &width, &height);
    if (width > 0 && height > 0) (void)w.session.resize(w.picture_width(), height);
    if (w.session.is_replaced())
      w.say(Error{w.session.names[w.session.shown_bake], "has been replaced on the disk: F5 shows it anew"});
    if (w.panel.notice_until > 0 && window_clock() >= w.panel.notice_until)  // it goes without an event, too
      w.panel.notice.clear(), w.panel.notice_until = 0, w.frames_due = 3;
    if (is_lost()) {
      if (auto ok = reopen(w); !ok) return ok;
      w.say(Error{"OpenGL", "its context was lost, and made anew"});
    }
    auto goes_on = run_script(w);
    if (!goes_on) return goes_on.error();
    if (!*goes_on) return {};
    if (w.played >= 0) {
      const double now = window_clock();
      w.say(w.session.advance(now - w.played)), w.played = now;
    }
    const bool hurry = window_clock() - w.last_input < rest;
    auto worked = w.session.work(hurry);
    if (!worked && (is_cancelled(w.job.progress) || !w.script.empty())) return worked.error();
    if (!worked && w.panel.notice != worked.error().text()) w.say(worked.error());  // tried again, at leisure
    busy = worked && (*worked || !w.session.settled());
    const bool fresh = w.session.is_fresh();
    if (!fresh && w.frames_due == 0) continue;
    w.frames_due = std::max(0, w.frames_due - 1);
    present(w);
    glfwSwapBuffers(w.handle);
  }
  if (is_cancelled(w.job.progress)) return Error{"", "cancelled"};
  return {};
}

}  // namespace

Result<void> run_window(const SessionOptions& o, const WindowOptions& options, const Job& job) {
  std::vector<Action> script;
  if (!options.script.empty()) {
    auto file = MappedFile::open(options.script);
    if (!file) return file.error();
    const auto bytes = file->bytes();
    auto parsed = parse_script(std::string(bytes.begin(), bytes.end()), options.script);
    if (!parsed) return parsed.error();
    script = std::move(*parsed);
  }
  auto session = Session::open(o, job);
  if (!session) return session.error();
  Window w{**session, options, job};
  w.script = std::move(script);
  auto result = make_window(w);
  if (result) result = loop(w);
  close_window(w);
  return result;
}

}  // namespace lambent::tool
