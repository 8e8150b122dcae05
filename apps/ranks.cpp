#include "apps/ranks.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <initializer_list>
#include <list>
#include <thread>

#include "apps/program.h"
#include "stability/files.h"

#ifdef DOFUSION_MPI
#define OMPI_SKIP_MPICXX 1  // the C interface is enough
#define MPICH_SKIP_MPICXX 1
#include <mpi.h>
#endif

namespace dofusion {
namespace {

// The first of these variables that is set to a number, of Open MPI, of PMIx and of MPICH and its kin.
std::optional<int> number_from(std::initializer_list<const char*> variables) {
  for (const char* variable : variables) {
    const char* text = std::getenv(variable);
    char* end = nullptr;
    const long value = text ? std::strtol(text, &end, 10) : 0;
    if (text && end != text && *end == '\0') return static_cast<int>(value);
  }
  return std::nullopt;
}

}  // namespace

int rank_from_environment() { return number_from({"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"}).value_or(0); }

int default_rank_threads() {
  const int allowed = default_threads();
  const int here = number_from({"OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS"}).value_or(1);
  const bool bound = allowed < static_cast<int>(std::thread::hardware_concurrency());
  return bound ? allowed : std::max(1, allowed / std::max(1, here));
}

#ifdef DOFUSION_MPI

struct Ranks::Mail {
  struct Letter {
    std::string bytes;
    MPI_Request request;
  };
  std::list<Letter> outgoing;

  void drop_sent() {
    outgoing.remove_if([](Letter& letter) {
      int sent = 0;
      MPI_Test(&letter.request, &sent, MPI_STATUS_IGNORE);
      return sent != 0;
    });
  }
};

Ranks::Ranks() {
  const auto size = number_from({"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"});
  const bool by_mpirun = size ? *size > 1 : number_from({"PMIX_RANK"}).has_value();
  if (!by_mpirun) return;
  int provided = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &count_);
  mail_ = std::make_unique<Mail>();
}

Ranks::~Ranks() {
  if (!mail_) return;
  if (first()) stop_the_others();
  for (Mail::Letter& letter : mail_->outgoing) MPI_Wait(&letter.request, MPI_STATUS_IGNORE);
  MPI_Finalize();
}

void Ranks::send(int to, int tag, std::string bytes) {
  mail_->drop_sent();
  Mail::Letter& letter = mail_->outgoing.emplace_back(Mail::Letter{std::move(bytes), MPI_REQUEST_NULL});
  MPI_Isend(letter.bytes.data(), static_cast<int>(letter.bytes.size()), MPI_BYTE, to, tag, MPI_COMM_WORLD,
            &letter.request);
}

std::optional<RankMessage> Ranks::receive() {
  if (!mail_) return std::nullopt;
  mail_->drop_sent();
  int arrived = 0, size = 0;
  MPI_Status status;
  MPI_Iprobe(MPI_ANY_SOURCE, MPI_ANY_TAG, MPI_COMM_WORLD, &arrived, &status);
  if (!arrived) return std::nullopt;
  MPI_Get_count(&status, MPI_BYTE, &size);
  RankMessage message{status.MPI_SOURCE, status.MPI_TAG, std::string(static_cast<std::size_t>(size), '\0')};
  MPI_Recv(message.bytes.data(), size, MPI_BYTE, message.from, message.tag, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
  return message;
}

#else

struct Ranks::Mail {};

Ranks::Ranks() {
  if (number_from({"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"}).value_or(1) > 1) {
    throw InputError("started by mpirun, but built without MPI; build with -DDOFUSION_MPI=ON");
  }
}

Ranks::~Ranks() = default;
void Ranks::send(int, int, std::string) {}
std::optional<RankMessage> Ranks::receive() { return std::nullopt; }

#endif

void Ranks::stop_the_others() {
  for (int other = 1; other < count_; ++other) send(other, kStop, "");
  // What they still send is taken and dropped, or they would wait for ever to be rid of it.
  for (int left = count_ - 1; left > 0;) {
    const auto message = receive();
    if (message && message->tag == kBye) --left;
    if (!message) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

}  // namespace dofusion
