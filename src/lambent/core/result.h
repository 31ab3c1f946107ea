#pragma once
// Errors that a user or a file can cause travel as values. Contracts between our own functions are asserted (check.h).
#include <optional>
#include <string>
#include <utility>
#include <variant>

namespace lambent {

// One line: where ("file.obj:12", "file.glb: accessor 3") and what was wrong. Never ends in a full stop or a newline.
struct Error {
  std::string where;
  std::string message;
  bool usage = false;  // what was asked for is wrong, not what was found: commands exit with 2 and not 1
  std::string text() const { return where.empty() ? message : where + ": " + message; }
};

// A value, or why there is none. Only what is there may be asked for: look first.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}
  explicit operator bool() const { return state_.index() == 0; }
  T& operator*() & { return std::get<0>(state_); }
  const T& operator*() const& { return std::get<0>(state_); }
  T&& operator*() && { return std::get<0>(std::move(state_)); }
  T* operator->() { return &std::get<0>(state_); }
  const T* operator->() const { return &std::get<0>(state_); }
  const Error& error() const { return std::get<1>(state_); }

 private:
  std::variant<T, Error> state_;
};

// Success or an error, nothing else to return.
template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)) {}
  explicit operator bool() const { return !error_; }
  const Error& error() const { return *error_; }

 private:
  std::optional<Error> error_;
};

}  // namespace lambent
