// One job on several processes ("ranks") that mpirun started, on one machine or on many. All of MPI is here.
#pragma once

#include <memory>
#include <optional>
#include <string>

namespace dofusion {

// This process's number in the job as the environment gives it, 0 for the first and for a plain start. For what comes
// before MPI is up, such as who prints that an argument is bad.
int rank_from_environment();

// Default for --threads: the processors that this rank may run on, shared with the other ranks of its machine where
// mpirun has not bound each to its own.
int default_rank_threads();

struct RankMessage {
  int from = 0;
  int tag = 0;
  std::string bytes;
};

// Starts MPI if the environment shows that mpirun started several processes; a plain start costs nothing and is a job
// of one rank. To be made and used on one thread. While the first rank's is alive the others must be in serve()
// (apps/shared_work.h); its destructor, whatever the reason, ends their service.
class Ranks {
 public:
  Ranks();  // throws InputError if mpirun started several processes but this build is without MPI
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  int rank() const { return rank_; }
  int count() const { return count_; }
  bool first() const { return rank_ == 0; }

  // Neither waits: a message goes out while the receiver and this rank go on calling receive(). Tags from kFirstFreeTag
  // on are the caller's.
  void send(int to, int tag, std::string bytes);
  std::optional<RankMessage> receive();  // the next message that has arrived, if any

  static constexpr int kStop = 1;  // from the first rank: leave serve()
  static constexpr int kBye = 2;   // to the first rank: left it
  static constexpr int kFirstFreeTag = 3;

 private:
  void stop_the_others();

  struct Mail;  // messages on their way
  std::unique_ptr<Mail> mail_;
  int rank_ = 0, count_ = 1;
};

}  // namespace dofusion
