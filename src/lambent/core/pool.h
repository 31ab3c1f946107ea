#pragma once
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

namespace lambent {

// Scratch objects that pieces of parallel work borrow and give back, so that there are as many as threads at work and
// each is allocated once.
template <class T, class Delete = std::default_delete<T>>
class Pool {
 public:
  explicit Pool(std::function<std::unique_ptr<T, Delete>()> make) : make_(std::move(make)) {}

  struct GiveBack {
    Pool* pool;
    void operator()(T* object) const {
      std::lock_guard lock(pool->mutex_);
      pool->free_.emplace_back(object);
    }
  };
  using Loan = std::unique_ptr<T, GiveBack>;

  Loan borrow() {
    std::unique_lock lock(mutex_);
    if (free_.empty()) {
      lock.unlock();
      return Loan(make_().release(), GiveBack{this});
    }
    T* object = free_.back().release();
    free_.pop_back();
    return Loan(object, GiveBack{this});
  }

 private:
  std::function<std::unique_ptr<T, Delete>()> make_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<T, Delete>> free_;
};

}  // namespace lambent
