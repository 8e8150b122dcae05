#include "apps/shared_work.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <exception>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

#include "apps/program.h"
#include "stability/files.h"

namespace dofusion {
namespace {

using Clock = std::chrono::steady_clock;

enum Tag : int {
  kJob = Ranks::kFirstFreeTag,  // first rank: the job's text
  kWanted,                      // others: how many items they can take
  kItems,                       // first rank: some items, none when there are no more
  kResults,                     // others: results, each with its item
  kBadInput,                    // others: the text of an InputError
  kFailed,                      // others: the text of another error
};

constexpr auto kPause = std::chrono::milliseconds(1);        // between looks for messages
constexpr auto kPauseAlone = std::chrono::milliseconds(20);  // where none can come: looking a thousand times a second
                                                             // took a quarter of a core from the work
constexpr std::size_t kMostAsked = 4096;                     // items that a rank holds at a time

void put(std::string& bytes, std::int64_t value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); }

std::int64_t take(const std::string& bytes, std::size_t& at) {
  std::int64_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  at += sizeof value;
  return value;
}

// Threads that do items from a queue until it is closed, and hand results on. The first exception stops them.
class Crew {
 public:
  using Deliver = std::function<void(std::int64_t item, std::string result)>;

  Crew(int threads, Work work, Deliver deliver) : work_(std::move(work)), deliver_(std::move(deliver)) {
    for (int thread = 0; thread < threads; ++thread) pool_.emplace_back([this, thread] { run(thread); });
  }
  ~Crew() { stop(); }

  void add(const std::vector<std::int64_t>& items) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      queue_.insert(queue_.end(), items.begin(), items.end());
    }
    changed_.notify_all();
  }

  // Up to `most` items off the queue's front, for others.
  std::vector<std::int64_t> give_away(std::size_t most) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto end = queue_.begin() + static_cast<std::ptrdiff_t>(std::min(most, queue_.size()));
    std::vector<std::int64_t> items(queue_.begin(), end);
    queue_.erase(queue_.begin(), end);
    return items;
  }

  std::size_t waiting() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return queue_.size();
  }

  std::exception_ptr error() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return error_;
  }

  // Ends once every thread is done with the item in hand.
  void stop() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      closed_ = true;
    }
    changed_.notify_all();
    for (std::thread& thread : pool_) thread.join();
    pool_.clear();
  }

 private:
  void run(int thread) {
    std::unique_lock<std::mutex> lock(mutex_);
    while (true) {
      changed_.wait(lock, [&] { return closed_ || !queue_.empty(); });
      if (closed_) return;
      const std::int64_t item = queue_.front();
      queue_.pop_front();
      lock.unlock();
      std::exception_ptr error;
      try {
        deliver_(item, work_(item, thread));
      } catch (...) {
        error = std::current_exception();
      }
      lock.lock();
      if (error && !error_) error_ = error;
      closed_ = closed_ || error;
    }
  }

  Work work_;
  Deliver deliver_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::int64_t> queue_;
  bool closed_ = false;
  std::exception_ptr error_;
  std::vector<std::thread> pool_;
};

std::string encoded(const std::vector<std::int64_t>& items) {
  std::string bytes;
  for (const std::int64_t item : items) put(bytes, item);
  return bytes;
}

std::vector<std::int64_t> decoded(const std::string& bytes) {
  std::vector<std::int64_t> items;
  for (std::size_t at = 0; at < bytes.size();) items.push_back(take(bytes, at));
  return items;
}

// What an exception says, as a message that the first rank throws again.
RankMessage report_of(const std::exception_ptr& error) {
  try {
    std::rethrow_exception(error);
  } catch (const InputError& e) {
    return {0, kBadInput, e.what()};
  } catch (const std::invalid_argument& e) {
    return {0, kBadInput, e.what()};
  } catch (const std::exception& e) {
    return {0, kFailed, e.what()};
  }
}

// How many items to ask for: as many as last about half a second.
class Appetite {
 public:
  explicit Appetite(int threads) : least_(2 * static_cast<std::size_t>(threads)), wanted_(least_) {}

  std::size_t next() {
    const double seconds = std::chrono::duration<double>(Clock::now() - asked_).count();
    if (seconds < 0.5) wanted_ = std::min(2 * wanted_, kMostAsked);
    if (seconds > 1.0) wanted_ = std::max(wanted_ / 2, least_);
    asked_ = Clock::now();
    return wanted_;
  }
  std::size_t low() const { return wanted_ / 2; }

 private:
  std::size_t least_, wanted_;
  Clock::time_point asked_ = Clock::now() - std::chrono::seconds(1);
};

// Results on their way to the first rank.
class Outbox {
 public:
  void add(std::int64_t item, const std::string& result) {
    const std::lock_guard<std::mutex> lock(mutex_);
    put(bytes_, item);
    put(bytes_, static_cast<std::int64_t>(result.size()));
    bytes_ += result;
  }
  std::string empty() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::exchange(bytes_, {});
  }

 private:
  std::mutex mutex_;
  std::string bytes_;
};

// Waits for the job; nothing if there is none.
std::optional<std::string> await_job(Ranks& ranks) {
  while (true) {
    const auto message = ranks.receive();
    if (message && message->tag == Ranks::kStop) return std::nullopt;
    if (message && message->tag == kJob) return message->bytes;
    if (!message) std::this_thread::sleep_for(kPause);
  }
}

// Works until the first rank says stop; then, or with an exception, the threads have ended.
void work_for_first(Ranks& ranks, int threads, const Work& work, bool& stopped) {
  Outbox outbox;
  Crew crew(threads, work, [&](std::int64_t item, const std::string& result) { outbox.add(item, result); });
  Appetite appetite(threads);
  bool asked = false, no_more = false;
  while (!stopped) {
    const auto message = ranks.receive();
    if (message && message->tag == Ranks::kStop) stopped = true;
    if (message && message->tag == kItems) {
      asked = false;
      no_more = message->bytes.empty();
      crew.add(decoded(message->bytes));
    }
    const std::string results = outbox.empty();
    if (!results.empty()) ranks.send(0, kResults, results);
    if (crew.error()) std::rethrow_exception(crew.error());
    if (interrupted() && !stopped) throw Interrupted("interrupted");
    if (!stopped && !asked && !no_more && crew.waiting() <= appetite.low()) {
      ranks.send(0, kWanted, encoded({static_cast<std::int64_t>(appetite.next())}));
      asked = true;
    }
    if (!message) std::this_thread::sleep_for(kPause);
  }
}

}  // namespace

void share_work(Ranks& ranks, const SharedWork& shared) {
  std::mutex mutex;
  std::atomic<std::size_t> collected{0};
  const auto collect = [&](std::int64_t item, const std::string& result) {
    const std::lock_guard<std::mutex> lock(mutex);
    shared.collect(item, result);
    ++collected;
  };
  const auto collect_all = [&](const std::string& bytes) {
    for (std::size_t at = 0; at < bytes.size();) {
      const std::int64_t item = take(bytes, at);
      const auto size = static_cast<std::size_t>(take(bytes, at));
      collect(item, bytes.substr(at, size));
      at += size;
    }
  };

  for (int other = 1; other < ranks.count(); ++other) ranks.send(other, kJob, shared.job);
  Crew crew(shared.threads, shared.work, collect);
  crew.add(shared.items);
  while (collected < shared.items.size()) {
    if (crew.error()) std::rethrow_exception(crew.error());
    if (interrupted()) throw Interrupted("interrupted");
    const auto message = ranks.receive();
    if (!message) {
      std::this_thread::sleep_for(ranks.count() > 1 ? kPause : kPauseAlone);
      continue;
    }
    const std::string from = ranks.count() > 1 ? "rank " + std::to_string(message->from) + ": " : "";
    switch (message->tag) {
      case kWanted: {
        const auto most = static_cast<std::size_t>(decoded(message->bytes).at(0));
        ranks.send(message->from, kItems, encoded(crew.give_away(most)));
        break;
      }
      case kResults:
        collect_all(message->bytes);
        break;
      case kBadInput:
        throw InputError(from + message->bytes);
      case kFailed:
        throw std::runtime_error(from + message->bytes);
      default:
        break;
    }
  }
}

void serve(Ranks& ranks, int threads, const std::function<Work(const std::string&)>& make_work) {
  bool stopped = false;
  const auto job = await_job(ranks);
  if (job) {
    try {
      work_for_first(ranks, threads, make_work(*job), stopped);
    } catch (...) {
      const RankMessage report = report_of(std::current_exception());
      ranks.send(0, report.tag, report.bytes);
      while (!stopped) {
        const auto message = ranks.receive();
        stopped = message && message->tag == Ranks::kStop;
        if (!message) std::this_thread::sleep_for(kPause);
      }
    }
  }
  ranks.send(0, Ranks::kBye, "");
}

}  // namespace dofusion
