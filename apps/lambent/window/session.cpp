#include "session.h"

#include "hold.h"
#include "srgb_bytes.h"

#include <lambent/core/file.h>
#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>
#include <lambent/pipeline/parse.h>
#include <lambent/pipeline/place.h>
#include <lambent/scene/load.h>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <sstream>
#include <tuple>

namespace lambent::tool {
namespace {

constexpr float most_height = 89.0f;  // degrees that an eye may stand above what it looks at

std::string camera_text(const Camera& c, Vec3d origin) {
  auto place = [&](Vec3 p) {
    return origin == Vec3d(0)
             ? fmt::format("{},{},{}", p.x, p.y, p.z)
             : fmt::format("{},{},{}", double(p.x) + origin.x, double(p.y) + origin.y, double(p.z) + origin.z);
  };
  return fmt::format("{},{},{}", place(c.eye), place(c.target), c.fov);
}

Vec3 turns_of(const std::string& text) {
  if (text.empty()) return Vec3(0.0f);
  const auto n = parse_numbers(text, 3, "--env-rotate");
  return n ? Vec3((*n)[0], (*n)[1], (*n)[2]) : Vec3(0.0f);
}

float wrapped(float degrees) {
  const float r = std::fmod(degrees, 360.0f);
  return r > 180 ? r - 360 : r <= -180 ? r + 360 : r;
}

double seconds_now() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

// Where the name ends in a value of an option that is given again.
size_t name_end(const std::string& option, const std::string& value) {
  return option == "insert"                                            ? value.rfind('@')
       : option == "place" || option == "move" || option == "material" ? value.find('=')
                                                                       : value.rfind('=');
}

// Of direct to indirect light that has no light yet: a lamp over the middle of the scene.
std::vector<std::string> lamps_to_begin_with(const Baked& baked, bool has_sky) {
  const Scene& scene = baked.scene;
  const bool glows = std::any_of(scene.materials.begin(), scene.materials.end(),
                                 [](const Material& m) { return largest(m.emissive) > 0; });
  if (has_sky || glows || !scene.lights.empty()) return {};
  return {lamp_over(scene, "sphere")};
}

// The pixel of a picture of another size at the same place.
const Vec3& at_same_place(const Image& image, int x, int y, int width, int height) {
  return image.at(std::min(x * image.width / width, image.width - 1),
                  std::min(y * image.height / height, image.height - 1));
}

void put(uint8_t* rgba, size_t pixel, Vec3 linear) {
  static const SrgbBytes bytes;
  const uint8_t four[4] = {bytes(linear.x), bytes(linear.y), bytes(linear.z), 255};
  std::copy_n(four, 4, rgba + 4 * pixel);
}

}  // namespace

Session::~Session() { reference.stop(); }

Result<std::unique_ptr<Session>> Session::open(const SessionOptions& options, const Job& job) {
  std::unique_ptr<Session> s(new Session(job));
  s->options = options;
  if (auto ok = check_display(options.draw.exposure, options.draw.tone); !ok) return ok.error();
  for (const std::string& path : options.baked) {
    auto baked = s->load(path);
    if (!baked) return baked.error();
    s->bakes.push_back(std::move(*baked)), s->names.push_back(path);
  }
  if (!options.reference.empty()) {
    auto image = load_image(options.reference);
    if (!image) return image.error();
    s->file = std::move(*image);
  }
  if (auto ok = s->show(0); !ok) return ok.error();
  return s;
}

// With a transfer texture any scene will do.
Result<std::unique_ptr<Baked>> Session::load(const std::string& path) const {
  const bool textured = !(live ? live->request() : options.draw).transfer_texture.empty();
  if (textured && !is_baked(path)) {
    auto scene = load_scene(path);
    if (!scene) return scene.error();
    auto out = std::make_unique<Baked>();
    out->scene = std::move(*scene);
    return out;
  }
  auto baked = load_baked(path);
  if (!baked) return baked.error();
  return std::make_unique<Baked>(std::move(*baked));
}

Result<void> Session::show(size_t bake) {
  DrawRequest request = live ? live->request() : options.draw;
  request.baked = names[bake];
  const LightBasis basis = light_of(bakes[bake]->surface.store);
  const bool distant = basis.order > 0 || !basis.lobes.empty() || cube_of(bakes[bake]->surface.store) > 0 ||
                       !request.transfer_texture.empty();
  if (!live && !options.env.empty()) request.env = options.env.front();
  else if (!live && distant) request.env = "sky:elevation=35,azimuth=45,turbidity=3";
  const bool dark = !live && kind_of(bakes[bake]->surface) == DrawKind::indirect && request.lamp.empty();
  if (dark) request.lamp = lamps_to_begin_with(*bakes[bake], !request.env.empty());
  auto made = LivePicture::make(*bakes[bake], request, job_);
  if (!made && live) {  // of another kind: with what goes with all
    DrawRequest plain{.baked = request.baked, .env = request.env, .env_rotate = request.env_rotate};
    plain.exposure = request.exposure, plain.tone = request.tone, plain.spp = request.spp, plain.size = request.size;
    if (auto again = LivePicture::make(*bakes[bake], plain, job_)) made = std::move(again);
  }
  if (!made) return made.error();
  reference.stop();
  other.reset(), against = Against::nothing, distance = {}, look = Look::picture;
  live = std::make_unique<LivePicture>(std::move(*made)), shown_bake = bake;
  std::error_code status;
  written_ = std::filesystem::last_write_time(names[bake], status);
  fresh_ = light_changed_ = true, measured_ = false;
  return {};
}

Result<void> Session::ask(const DrawRequest& request) {
  if (auto ok = check_display(request.exposure, request.tone); !ok) return ok;
  const DrawRequest before = live->request();
  const bool traced = against == Against::reference;
  if (traced) reference.stop();  // its scene may change
  if (auto ok = live->ask(request); !ok) return ok;
  if (before.transfer_texture.empty() != request.transfer_texture.empty()) {  // another kind
    look = Look::picture;
    if (traced) against = Against::nothing;
  }
  if (other) {
    DrawRequest same = request;
    same.baked = names[other_bake];
    if (auto ok = other->ask(same); !ok) job_.warn(ok.error().text());
  }
  light_changed_ |= before.env != request.env || before.env_rotate != request.env_rotate ||
                    before.lamp != request.lamp || before.brdf != request.brdf || before.show != request.show ||
                    before.material != request.material || before.albedo != request.albedo;
  const bool shown_alike = before.exposure == request.exposure && before.tone == request.tone;
  if (!shown_alike) measured_ = false;
  fresh_ = true, distance = {};
  if (traced) reference.stop(), seen_paths_ = 0;
  return {};
}

Result<void> Session::set(const std::string& option, const std::string& value) {
  DrawRequest request = live->request();
  for (const Option<DrawRequest>& o : draw_options()) {
    if (option != o.name || option == "baked" || option == "output") continue;
    bool number_ok = true;
    std::visit(
        [&](auto member) {
          using T = std::remove_cvref_t<decltype(request.*member)>;
          if constexpr (std::is_same_v<T, std::string>) request.*member = value;
          else if constexpr (std::is_same_v<T, std::vector<std::string>>) {
            auto& list = request.*member;
            const auto name = [&](const std::string& v) { return v.substr(0, name_end(option, v)); };
            const auto same =
                std::find_if(list.begin(), list.end(), [&](const auto& v) { return name(v) == name(value); });
            const bool out = name_end(option, value) + 1 == value.size();
            if (same == list.end() && !out) list.push_back(value);
            else if (same != list.end() && out) list.erase(same);
            else if (same != list.end()) *same = value;
          } else {
            const auto n = parse_numbers(value, 1, "--" + option);
            number_ok = bool(n);
            if (n) request.*member = T((*n)[0]);
          }
        },
        o.member);
    if (!number_ok) return Error{"--" + option, "must be a number, not \"" + value + "\"", true};
    return ask(request);
  }
  return Error{option, "is no option of a drawing", true};
}

Result<void> Session::clear(const std::string& option) {
  DrawRequest request = live->request();
  for (const Option<DrawRequest>& o : draw_options())
    if (option == o.name) std::visit([&](auto member) { request.*member = DrawRequest().*member; }, o.member);
  return ask(request);
}

Result<void> Session::turn_light(float yaw, float pitch) {
  DrawRequest request = live->request();
  if (request.env.empty()) return Error{"light", "nothing shines from afar: there is no environment to turn"};
  const Vec3 turns = turns_of(request.env_rotate);
  const Vec3 next(wrapped(turns.x + yaw), wrapped(turns.y + (level ? 0.0f : pitch)), turns.z);
  request.env_rotate = next == Vec3(0.0f) ? "" : fmt::format("{},{},{}", next.x, next.y, next.z);
  return ask(request);
}

Result<void> Session::orbit(float yaw, float pitch) {
  Camera c = live->view().camera;
  const Vec3 arm = c.eye - c.target;
  const float distance_to = length(arm), height = degrees(std::asin(std::clamp(arm.y / distance_to, -1.0f, 1.0f)));
  const float azimuth = std::atan2(arm.x, arm.z) + radians(yaw);
  const float up = radians(std::clamp(height + pitch, -most_height, most_height));
  c.eye = c.target +
          distance_to * Vec3(std::cos(up) * std::sin(azimuth), std::sin(up), std::cos(up) * std::cos(azimuth));
  return set("camera", camera_text(c, live->scene().origin));
}

Result<void> Session::pan(float right, float up) {
  Camera c = live->view().camera;
  const CameraRays rays(c, live->view().width, live->view().height);
  const float height = 2 * length(c.eye - c.target) * std::tan(radians(c.fov) / 2);
  const Vec3 shift = -right * height * normalize(rays.dx) + up * height * normalize(rays.dy);
  c.eye += shift, c.target += shift;
  return set("camera", camera_text(c, live->scene().origin));
}

Result<void> Session::dolly(float factor) {
  if (!(factor > 0.01f && factor < 100)) return Error{"dolly", "must lie between 0.01 and 100", true};
  Camera c = live->view().camera;
  c.eye = c.target + factor * (c.eye - c.target);
  return set("camera", camera_text(c, live->scene().origin));
}

Result<void> Session::resize(int width, int height) {
  const View& v = live->view();
  width = std::clamp(width, 1, 8192), height = std::clamp(height, 1, 8192);
  if (width == v.width && height == v.height) return {};
  if (std::holds_alternative<FixedView>(bakes[shown_bake]->surface.where)) return {};
  return set("size", fmt::format("{}x{}", width, height));
}

Result<void> Session::look_as(Look next, int number) {
  if (auto ok = live->look_as(next, number); !ok) return ok;
  look = next, fresh_ = true, light_changed_ = true, measured_ = false;
  return {};
}

Result<void> Session::drop(const std::string& path) {
  const std::string ending = file_extension(path);
  const bool is_scene = ending == "glb" || ending == "gltf" || ending == "obj" || ending == "ply";
  const bool textured = !live->request().transfer_texture.empty();
  if (is_baked(path) || (is_scene && textured)) {
    auto baked = load(path);
    if (!baked) return baked.error();
    bakes.push_back(std::move(*baked)), names.push_back(path);
    auto shown = show(bakes.size() - 1);
    if (!shown) bakes.pop_back(), names.pop_back();
    return shown;
  }
  if (is_scene) return Error{path, "is a scene and no bake: `lambent bake` makes one of it"};
  return set(ending == "lpt" ? "transfer-texture" : "env", path);
}

bool Session::is_replaced() {
  if (const double now = seconds_now(); now - looked_ < 1) return false;
  else looked_ = now;
  std::error_code status;
  const auto written = std::filesystem::last_write_time(names[shown_bake], status);
  if (status || written == written_) return false;
  written_ = written;  // said once
  return true;
}

Result<void> Session::reload() {
  auto baked = load(names[shown_bake]);
  if (!baked) return baked.error();
  std::swap(bakes[shown_bake], *baked);
  auto shown = show(shown_bake);
  if (!shown) std::swap(bakes[shown_bake], *baked);
  return shown;
}

Result<void> Session::compare_with(Against next, size_t bake) {
  if (next == Against::file && options.reference.empty())
    return Error{"compare", "no picture was given: --reference", true};
  if (next == Against::reference && !live->request().transfer_texture.empty())
    return Error{"compare", "the path tracer sees the mesh alone, without the relief of a transfer texture", true};
  if (next == Against::bake) {
    if (bake >= bakes.size()) return Error{"compare", "no such bake was given", true};
    DrawRequest same = live->request();
    same.baked = names[bake];
    auto made = LivePicture::make(*bakes[bake], same, job_);
    if (!made) return made.error();
    other = std::make_unique<LivePicture>(std::move(*made)), other_bake = bake;
  } else {
    other.reset();
  }
  reference.stop(), seen_paths_ = 0;
  against = next, distance = {}, fresh_ = true;
  return {};
}

void Session::restart_reference() {
  if (against != Against::reference || reference.running() || reference.paths() > 0) return;
  const Baked& baked = *bakes[shown_bake];
  const LightBasis basis = light_of(baked.surface.store);
  const int asked = live->request().light_order;
  const int order = basis.order == 0 || !basis.lobes.empty() ? 0 : asked ? std::min(asked, basis.order) : basis.order;
  reference.start(*live, reference_options(baked, live->request()), same_bands ? order : 0);
}

bool Session::settled() const { return live->done() && (!other || other->done()); }

Result<bool> Session::work(bool hurry) {
  const double start = seconds_now();
  auto worked = live->work(hurry);
  if (!worked) return worked;
  bool more = *worked;
  if (more) {
    const LiveTimes& now = live->times();
    for (double LiveTimes::*ms : {&LiveTimes::project, &LiveTimes::relight, &LiveTimes::trace, &LiveTimes::shade})
      if (now.*ms > 0) times.*ms = now.*ms;
    if (now.shaded > 0) times.shaded = now.shaded;
  }
  if (other) {
    auto beside = other->work(hurry);
    if (!beside) return beside;
    more |= *beside;
  }
  if (more && !live->is_measuring()) {
    fresh_ = true;
    frames.push_back(float(1e3 * (seconds_now() - start)));
    if (frames.size() > 240) frames.erase(frames.begin());
  }
  if (against == Against::reference) {
    if (more || !settled()) {
      if (reference.running()) reference.stop();
    } else {
      restart_reference();
    }
    if (const int paths = reference.paths(); paths != seen_paths_) seen_paths_ = paths, fresh_ = true;
  }
  return more;
}

void Session::measure(bool done) {
  const DrawRequest& request = live->request();
  const double now = seconds_now();
  const bool automatic = request.exposure == "auto";
  // As the page: when the light changes and not with the camera, at most three times a second.
  const bool due = !measured_ || (automatic && light_changed_ && (done || now - last_exposure_ > 0.33));
  if (!due || live->samples() == 0) return;
  const Image& image = live->image();
  const bool is_light = look == Look::picture || look == Look::rows || look == Look::coefficient;
  if (!is_light) display = Display();  // colours are shown as they are
  else if (auto parsed = parse_display(request.exposure, request.tone, std::span(&image, 1))) display = *parsed;
  measured_ = true, last_exposure_ = now;
  if (done) light_changed_ = false;
}

void Session::paint(uint8_t* rgba) {
  fresh_ = false;
  measure(settled());
  const View& view = live->view();
  const Image& image = live->image();
  LiveReference::Seen traced;
  const Image* right = nullptr;
  if (against == Against::bake && other && other->samples() > 0) right = &other->image();
  if (against == Against::file) right = &file;
  if (against == Against::reference && (traced = reference.seen(), traced.paths > 0)) right = &traced.image;
  const int cut = right && !difference ? int(std::lround(wipe * float(view.width))) : view.width;
  parallel_for(size_t(view.height), 8, [&](size_t begin, size_t end) {
    for (int y = int(begin); y < int(end); ++y)
      for (int x = 0; x < view.width; ++x) {
        const size_t pixel = size_t(y) * size_t(view.width) + size_t(x);
        auto look = [&](const Image& of) {
          return lambent::shown(at_same_place(of, x, y, view.width, view.height), display);
        };
        if (right && difference) {
          const Vec3 a = look(image), b = look(*right);
          float most = 0;
          for (int c = 0; c < 3; ++c) most = std::max(most, std::abs(srgb_encode(a[c]) - srgb_encode(b[c])));
          put(rgba, pixel, false_color(10 * most));
        } else {
          put(rgba, pixel, x == cut ? Vec3(1.0f) : look(x < cut ? image : *right));
        }
      }
  });
  dropped_pixels = std::max(1, view.width / std::max(1, image.width));
  if (right && settled() && right->width == image.width && right->height == image.height) {
    if (auto apart = compare_images(image, *right, display, against != Against::reference))
      distance = {apart->psnr, apart->flip, true};
  }
}

Result<void> Session::save(const std::string& path) const {
  if (auto ok = check_output(path, {"png", "exr"}); !ok) return ok;
  return save_image(path, live->image(), display);
}

std::string Session::command() const {
  const DrawRequest& request = live->request();
  std::string out = "lambent render " + request.baked;
  const DrawRequest plain;
  auto quoted = [](const std::string& text) {
    return text.find_first_of(" '\"$&;|<>()*?\\") == std::string::npos ? text : "'" + text + "'";
  };
  for (const Option<DrawRequest>& o : draw_options()) {
    if (std::string(o.name) == "baked" || std::string(o.name) == "output") continue;
    std::visit(
        [&](auto member) {
          using T = std::remove_cvref_t<decltype(request.*member)>;
          if (request.*member == plain.*member) return;
          if constexpr (std::is_same_v<T, std::vector<std::string>>)
            for (const std::string& value : request.*member) out += fmt::format(" --{} {}", o.name, quoted(value));
          else if constexpr (std::is_same_v<T, std::string>)
            out += fmt::format(" --{} {}", o.name, quoted(request.*member));
          else out += fmt::format(" --{} {}", o.name, request.*member);
        },
        o.member);
  }
  return out + " -o picture.png";
}

std::string sky_text(const SkyOptions& sky) {
  const SkyOptions plain;
  std::string out =
      fmt::format("sky:elevation={:.4g},azimuth={:.5g},turbidity={:.3g}", sky.elevation, sky.azimuth, sky.turbidity);
  if (sky.ground != plain.ground) out += fmt::format(",ground={:.4g}", sky.ground.x);
  if (sky.sun != plain.sun) out += ",sun=off";
  if (sky.width != plain.width) out += fmt::format(",width={}", sky.width);
  return out;
}

Result<std::vector<Action>> parse_script(const std::string& text, const std::string& name) {
  // Verbs, and how many words follow: at least, at most.
  static const std::map<std::string, std::pair<size_t, size_t>> verbs{
      {"set", {2, 2}},    {"turn-light", {1, 2}}, {"orbit", {2, 2}},  {"pan", {2, 2}},        {"dolly", {1, 1}},
      {"look", {1, 2}},   {"compare", {1, 2}},    {"wipe", {1, 1}},   {"difference", {1, 1}}, {"drop", {1, 1}},
      {"settle", {0, 0}}, {"wait", {1, 1}},       {"frames", {1, 1}}, {"save", {1, 1}},       {"screenshot", {1, 1}},
      {"film", {3, 3}},   {"lamp", {1, 2}},       {"reload", {0, 0}}, {"reopen", {0, 0}},     {"size", {1, 1}},
      {"panel", {1, 1}},  {"stay", {0, 0}}};
  std::vector<Action> out;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::istringstream words(line.substr(0, line.find('#')));
    Action action{.line = number};
    if (!(words >> action.verb)) continue;
    for (std::string word; words >> word;) action.words.push_back(word);
    const auto verb = verbs.find(action.verb);
    const std::string where = fmt::format("{}: line {}", name, number);
    if (verb == verbs.end()) return Error{where, "there is no action \"" + action.verb + "\"", true};
    if (action.words.size() < verb->second.first || action.words.size() > verb->second.second)
      return Error{
          where,
          fmt::format("{} wants {} word{}", action.verb, verb->second.second, verb->second.second == 1 ? "" : "s"),
          true};
    out.push_back(std::move(action));
  }
  return out;
}

}  // namespace lambent::tool
