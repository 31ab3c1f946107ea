#include <lambent/core/progress.h>

namespace lambent {

void Progress::begin(std::string stage, size_t total) {
  std::lock_guard lock(mutex_);
  stage_ = std::move(stage), total_ = total, done_ = 0;
  if (report_) report_(stage_, 0.0);
}

void Progress::advance(size_t amount) {
  std::lock_guard lock(mutex_);
  done_ += amount;
  if (report_ && total_) report_(stage_, double(done_) / double(total_));
}

void Progress::end() {
  std::lock_guard lock(mutex_);
  if (report_) report_(stage_, 1.0);
}

}  // namespace lambent
