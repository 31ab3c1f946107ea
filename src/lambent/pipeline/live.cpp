#include <lambent/pipeline/live.h>

#include <lambent/core/clock.h>
#include <lambent/pipeline/live_state.h>

#include <algorithm>
#include <thread>

namespace lambent {
namespace {

bool is_same(const DrawRequest& a, const DrawRequest& b, std::initializer_list<const char*> names) {
  for (const Option<DrawRequest>& o : draw_options())
    if (std::find(names.begin(), names.end(), std::string(o.name)) != names.end() &&
        !std::visit([&](auto member) { return a.*member == b.*member; }, o.member))
      return false;
  return true;
}

}  // namespace

LivePicture::LivePicture(std::unique_ptr<State> state) : state_(std::move(state)) {}
LivePicture::LivePicture(LivePicture&&) noexcept = default;
LivePicture& LivePicture::operator=(LivePicture&&) noexcept = default;
LivePicture::~LivePicture() = default;

namespace {

struct Parsed {
  View view;
  Mat3 turn{1.0f};
};

// All of a request that can be wrong but for its files. `known`: its view, if that is what it was; a camera about the
// whole looks at every vertex.
Result<Parsed> parse_live(const Baked& baked, const DrawRequest& request, const View* known = nullptr) {
  for (const char* option : {"frames", "indirect"})
    if (is_given(request, json_name(option)))
      return Error{std::string("--") + option, "is not shown live: `lambent render` draws it", true};
  const bool textured = !request.transfer_texture.empty();
  if (auto ok = textured ? check_draw(request, DrawKind::texture) : check_draw(request, baked); !ok) return ok.error();
  auto turn = parse_rotation(request.env_rotate, "--env-rotate");
  if (!turn) return turn.error();
  if (const auto* fixed = std::get_if<FixedView>(&baked.surface.where); fixed && !textured)
    return Parsed{View{fixed->camera, fixed->width, fixed->height}, *turn};
  auto view = known ? Result<View>(*known) : parse_view(request.camera, request.size, baked.scene);
  if (!view) return view.error();
  return Parsed{*view, *turn};
}

}  // namespace

Result<LivePicture> LivePicture::make(const Baked& baked, const DrawRequest& request, const Job& job) {
  auto parsed = parse_live(baked, request);
  if (!parsed) return parsed.error();
  auto state = std::unique_ptr<State>(new State{baked, request, job, parsed->view});
  state->turn = parsed->turn;
  if (auto ok = state->make_environment_due(); !ok) return ok.error();
  if (auto ok = state->make_kind(); !ok) return ok.error();
  state->due.environment = state->due.materials = state->due.pose = false;
  return LivePicture(std::move(state));
}

// Of a kind with steps of its own; `sky`: the environment is another.
Result<void> LivePicture::State::ask_kind(const DrawRequest& request, const DrawRequest& before, bool sky) {
  if (sky)
    if (auto ok = make_environment_due(); !ok) return (void)(asked = before, make_environment_due()), ok;
  auto made = kind->ask(request, skies());
  if (!made) {
    asked = before;
    if (sky) (void)make_environment_due();
    return made.error();
  }
  due.light |= made->light, due.rays |= made->rays, due.shades |= made->shades;
  return {};
}

// Of columns and blocks.
Result<void> LivePicture::State::ask_parts(const DrawRequest& request, const DrawRequest& before, bool sky) {
  const bool materials =
      !is_same(before, request, {"brdf", "material", "show", "method", "brdf-samples", "tolerance", "terms", "insert"});
  const bool places = !is_same(before, request, {"place", "move", "pose", "lamp-bounces"});
  const bool time = before.time != request.time;
  const bool objects = places || !is_same(before, request, {"insert"}) ||
                       (time && !request.place.empty() && (!request.move.empty() || !request.pose.empty()));
  const bool left_alone = has_objects() && request.place.empty() && request.insert.empty();
  const bool posed_anew = left_alone || !is_same(before, request, {"animation", "deform"}) ||
                          (time && !request.animation.empty());
  auto made = [&]() -> Result<void> {
    if (sky)
      if (auto ok = make_environment_due(); !ok) return ok;
    if (materials)
      if (auto ok = make_materials(); !ok) return ok;
    if (places)
      if (auto ok = make_objects(); !ok) return ok;
    if (left_alone) company.reset();  // the pose is of the scene alone
    return posed_anew ? make_pose() : Result<void>();
  }();
  if (!made) {  // back to what was, which did not fail
    asked = before;
    if (sky) (void)make_environment_due();
    if (materials) (void)make_materials();
    if (places) (void)make_objects();
    if (posed_anew) (void)make_pose();
    if (has_objects()) due.objects = due.values = true;
    if (materials || sky) due.light = true;
    return made;
  }
  due.light |= sky || materials || !is_same(before, request, {"env-rotate", "lamp", "sphere-lamp", "move"}) ||
               (time && asked.place.empty() && !request.move.empty());
  due.values |= posed_anew || objects, due.rays |= posed_anew, due.objects |= objects;
  return {};
}

Result<void> LivePicture::ask(const DrawRequest& request) {
  State& s = *state_;
  auto parsed = parse_live(s.baked, request, is_same(s.asked, request, {"camera", "size"}) ? &s.view : nullptr);
  if (!parsed) return parsed.error();
  const DrawRequest before = s.asked;
  if (before.transfer_texture.empty() != request.transfer_texture.empty()) {  // another kind
    auto other = make(s.baked, request, s.job);
    if (!other) return other.error();
    return *this = std::move(*other), Result<void>();
  }
  const bool sky = !is_same(before, request, {"env", "light-order", "window"}) ||
                   before.environment != request.environment;
  const Mat3 turn = std::exchange(s.turn, parsed->turn);
  s.asked = request;
  if (auto ok = s.kind ? s.ask_kind(request, before, sky) : s.ask_parts(request, before, sky); !ok)
    return s.turn = turn, ok;
  const View& old = s.view;
  s.due.rays |= !(old.camera.eye == parsed->view.camera.eye && old.camera.target == parsed->view.camera.target &&
                  old.camera.fov == parsed->view.camera.fov && old.width == parsed->view.width &&
                  old.height == parsed->view.height);
  s.due.shades |= !is_same(before, request, {"background"}) || before.spp > request.spp;
  s.view = parsed->view;
  return {};
}

const DrawRequest& LivePicture::request() const { return state_->asked; }

Result<void> LivePicture::look_as(Look look, int number) {
  State& s = *state_;
  const bool textured = !s.asked.transfer_texture.empty();
  if (textured && look != Look::picture && look != Look::density)
    return Error{"look", "a transfer texture has its picture and its mesh alone", true};
  if (!textured)
    if (auto ok = check_look(look, number, s.baked, s.rows); !ok) return ok;
  const bool of_column = look == Look::coefficient || s.look == Look::coefficient;
  (of_column ? s.due.light : s.due.shades) |= s.look != look || s.number != number;
  s.look = look, s.number = number;
  return {};
}

namespace {

Result<void> timed(double& ms, auto&& run) {
  const auto start = Clock::now();
  auto ok = run();
  ms = 1e3 * seconds_from(start);
  return ok;
}

}  // namespace

// Light, and what receivers have of it; true: there is something to shade.
Result<bool> LivePicture::State::work_on_light(bool hurry, double budget) {
  if (kind) {
    if (due.rays) forget_rays();
    if (due.light || (draft_light && !hurry))
      if (auto ok = light_kind(hurry, budget); !ok) return ok.error();
    return choose_scale(hurry, budget), !due.light || hurry;
  }
  if (due.light || (draft_light && !hurry)) {
    if (auto ok = timed(times.project, [&] { return project(hurry); }); !ok) return ok.error();
    due.light = false, due.values = true;
  }
  if (due.rays) {
    forget_rays();
    if (blocks || draft_values) due.values = true;  // radiance of blocks depends on the eye; others are seen
  }
  choose_scale(hurry, budget);
  if (due.values && hurry && can_shade_what_is_seen() && receivers_in_view().empty()) {  // rays tell what is seen
    restart();
    if (auto ok = add_sample(hurry); !ok) return ok.error();
  }
  if (due.values || (draft_values && !hurry)) {
    if (auto ok = timed(times.relight, [&] { return make_values(hurry, budget); }); !ok) return ok.error();
    due.values = false, due.shades = true;
  }
  return true;
}

// Whether what the look needs is known; else it is being found.
bool LivePicture::State::can_look() {
  if (!LookMeasure::is_for(look)) return true;
  if (!measured.knows(look)) {
    measured.start(look, baked);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    return false;
  }
  if (const std::string why = measured.failure(); !why.empty()) job.warn(why), look = Look::picture, due.shades = true;
  return true;
}

Result<bool> LivePicture::work(bool hurry, double budget) {
  State& s = *state_;
  s.times = {};
  if (done()) return false;
  auto lit = s.work_on_light(hurry, budget);
  if (!lit) return lit.error();
  if (!*lit) return true;
  if (!s.can_look()) return s.due.shades = true;
  if (s.due.shades || (s.draft_shades && !hurry)) s.restart(), s.due.shades = s.draft_shades = false;
  if (s.sums.samples < s.asked.spp)
    if (auto ok = s.add_sample(hurry); !ok) return ok.error();
  return true;
}

bool LivePicture::done() const {
  const State& s = *state_;
  return !s.due.light && !s.due.values && !s.due.rays && !s.due.shades && !s.draft_light && !s.draft_values &&
         !s.draft_shades && s.scale == 1 && s.sums.samples >= s.asked.spp;
}

bool LivePicture::is_measuring() const {
  return LookMeasure::is_for(state_->look) && !state_->measured.knows(state_->look);
}
int LivePicture::samples() const { return state_->sums.samples; }
const Image& LivePicture::image() const { return state_->image; }
const View& LivePicture::view() const { return state_->view; }
const Scene& LivePicture::scene() const { return state_->scene(); }
std::shared_ptr<const Scene> LivePicture::lit_scene() const {
  if (state_->kind)
    if (auto lit = state_->kind->lit_scene()) return lit;
  return std::shared_ptr<const Scene>(std::shared_ptr<void>(), &state_->scene());
}
std::vector<std::string> LivePicture::lamp_names() const {
  return state_->kind ? state_->kind->lamp_names() : state_->light_basis().groups;
}
const Environment* LivePicture::environment() const { return state_->light[0].env ? &*state_->light[0].env : nullptr; }
const Breakdown* LivePicture::breakdown() const { return state_->blocks ? &state_->blocks->breakdown : nullptr; }
const LiveTimes& LivePicture::times() const { return state_->times; }

Hit LivePicture::pick(Vec2 at) const {
  const State& s = *state_;
  if (!s.rays_of()) return {};
  const CameraRays rays(s.view.camera, s.view.width, s.view.height);
  return s.rays_of()->closest(rays.eye, rays.direction(at.x * float(s.view.width), at.y * float(s.view.height)));
}

std::optional<size_t> LivePicture::object_of(const Hit& hit) const {
  const std::optional<Company>& with = state_->company;
  if (!with || hit.triangle == none) return std::nullopt;
  const auto after = std::upper_bound(with->first.begin(), with->first.end(), size_t(hit.triangle));
  if (after == with->first.begin()) return std::nullopt;
  return size_t(after - with->first.begin()) - 1;
}

}  // namespace lambent
