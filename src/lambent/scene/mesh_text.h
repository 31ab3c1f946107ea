#pragma once
// Reading the words and numbers of OBJ, MTL and PLY. No locale is asked.
#include <lambent/core/result.h>
#include <lambent/core/vec.h>

#include <span>
#include <string>
#include <string_view>

namespace lambent {

inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }
void skip_blanks(std::string_view& text);
std::string_view trimmed(std::string_view text);

// Removes the first word and the blanks before it.
std::string_view take_word(std::string_view& text);

// Reads one decimal number at the front of `text` and removes it; false if there is none. "nan", "inf" and overflow
// give non-finite values; underflow gives zero.
bool take_number(std::string_view& text, double& value);

// A trimmed name as valid UTF-8 (other bytes are taken for Latin-1), cut to 256 bytes so that copies of it stay small.
std::string short_name(std::string_view text);

// File name without folder and extension, as a short_name.
std::string file_stem(const std::string& path);

// Texture space of OBJ and PLY has v = 0 at the image's bottom, Scene's at the top. Non-finite numbers give 0.
Vec2 texcoord_from_below(double u, double v);

// To [0, 1]; NaN gives 1.
Vec3 clamp_color(double r, double g, double b);

// An error where the bytes are text of two bytes a character, as some editors save it.
Result<void> check_not_utf16(std::span<const uint8_t> bytes, const std::string& path);

// Lines, less the mark that UTF-8 may begin with; ended by LF, CR LF or (in a file without LF) CR; a backslash at the
// end joins the next line.
class LineReader {
 public:
  explicit LineReader(std::span<const uint8_t> bytes);
  // False at the end. The text lives until the next call.
  bool next(std::string_view& line);
  // Of the line last given, from 1; of the first where several were joined.
  size_t number() const { return number_; }

 private:
  std::string_view take();
  std::string_view rest_;
  char separator_ = '\n';
  size_t number_ = 0, taken_ = 0;
  std::string joined_;
};

}  // namespace lambent
