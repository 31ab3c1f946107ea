#pragma once
// What stands behind the handles of lambent.h, and how its functions fail.
#include <lambent.h>

#include <lambent/baked/fields.h>
#include <lambent/relight/relighter.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <new>
#include <string>
#include <string_view>
#include <vector>

namespace lambent::c {

struct OpenFile {
  BakedFields fields;
  LightBasis light;                   // the surface's, whose group names are lent out
  std::vector<std::string> rows_are;  // by field
  size_t count() const { return 1 + fields.more.size(); }
  const Field& field(size_t i) const { return i == 0 ? fields.surface : fields.more[i - 1]; }
};

// Keeps the text for lambent_error().
lambent_code fail(lambent_code code, std::string_view text) noexcept;
inline lambent_code wrong(std::string_view text) { return fail(LAMBENT_ARGUMENT, text); }

// Runs body, whose exceptions become codes.
template <class Body>
lambent_code guarded(const Body& body) noexcept {
  try {
    return body();
  } catch (const std::bad_alloc&) {
    return fail(LAMBENT_MEMORY, "out of memory");
  } catch (const std::exception& e) {
    return fail(LAMBENT_INTERNAL, e.what());
  } catch (...) {
    return fail(LAMBENT_INTERNAL, "an unknown fault");
  }
}
// And only where none of the pointers that it will follow is null.
template <class Body, class... P>
lambent_code guarded_with(const Body& body, const P*... pointers) noexcept {
  if ((!pointers || ...)) return fail(LAMBENT_NULL, "a handle or a pointer is null");
  return guarded(body);
}

inline bool finite(const float* values, size_t count) {
  return std::all_of(values, values + count, [](float v) { return std::isfinite(v); });
}
inline Vec3 color_at(const float* rgb, size_t i) { return {rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]}; }
inline Mat3 matrix_at(const float* m) { return {color_at(m, 0), color_at(m, 1), color_at(m, 2)}; }
inline bool is_rotation(const Mat3& m) {
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j)
      if (!(std::abs(dot(m[i], m[j]) - float(i == j)) < 1e-3f)) return false;
  return determinant(m) > 0;
}

}  // namespace lambent::c

struct lambent_file {
  std::shared_ptr<const lambent::c::OpenFile> open;
};

struct lambent_relighter {
  std::shared_ptr<const lambent::c::OpenFile> open;
  lambent::Relighter relighter;
  lambent::LightBasis basis;
  std::vector<lambent::Vec3> columns;  // harmonics, lobes, groups
  bool lit = false;                    // nothing of the columns but groups has a value unless it is set
  bool changed = true;                 // since the relighter had them
  bool turned = false;
  lambent::ReceiverFrames frames = {};
  lambent::Vec3 eye{0};  // of blocks
  size_t distant() const { return basis.count() - basis.groups.size(); }
  int cube() const { return lambent::cube_of(relighter.field().store); }  // 0: light comes by columns
  const lambent::Visibility* blocks() const { return std::get_if<lambent::Visibility>(&relighter.field().store); }
};

namespace lambent::c {

inline lambent_code new_relighter(const lambent_file& file, const Field& field, RelighterOptions options,
                                  lambent_relighter** out) {
  auto made = Relighter::make(field, std::move(options));
  if (!made) return fail(LAMBENT_INTERNAL, made.error().text());
  LightBasis basis = light_of(field.store);
  std::vector<Vec3> columns(basis.count(), Vec3(0));
  std::fill(columns.end() - ptrdiff_t(basis.groups.size()), columns.end(), Vec3(1));
  const bool lit = !columns.empty() && basis.groups.size() == basis.count();
  *out = new lambent_relighter{file.open, std::move(*made), std::move(basis), std::move(columns), lit};
  return LAMBENT_OK;
}

}  // namespace lambent::c
