#include "server/routes/kept_answers.h"

#include <utility>

namespace gridcast::server {

std::shared_ptr<KeptAnswers::Entry> KeptAnswers::open(const std::string& key, const std::string& request) {
  const std::lock_guard lock(mutex_);
  while (!kept_.empty() && kept_.front().forget_at <= Clock::now()) forget_oldest();
  std::shared_ptr<Entry>& entry = entries_[key];
  if (!entry) entry = std::make_shared<Entry>(request);
  return entry;
}

void KeptAnswers::keep(const std::string& key, const std::shared_ptr<Entry>& entry,
                       const HttpResponse& answer) {
  const std::size_t bytes = key.size() + entry->request.size() + answer.body.size();
  if (bytes > max_bytes_) return;
  entry->answer = answer;
  const std::lock_guard lock(mutex_);
  kept_.push_back({key, bytes, Clock::now() + keep_});
  bytes_ += bytes;
  while (kept_.size() > max_count_ || bytes_ > max_bytes_) forget_oldest();
}

void KeptAnswers::close(const std::string& key, std::shared_ptr<Entry> entry) {
  const std::lock_guard lock(mutex_);
  const auto known = entries_.find(key);
  // Users get theirs and lose it under the lock: two are this one's and the map's, and the answer is
  // nobody's.
  if (known != entries_.end() && known->second == entry && entry.use_count() == 2 && !entry->answer)
    entries_.erase(known);
  entry.reset();
}

void KeptAnswers::forget_oldest() {
  bytes_ -= kept_.front().bytes;
  entries_.erase(kept_.front().key);
  kept_.pop_front();
}

}  // namespace gridcast::server
