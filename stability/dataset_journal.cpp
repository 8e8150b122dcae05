#include "stability/dataset_journal.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <string_view>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include "stability/files.h"

namespace dofusion {
namespace {

constexpr std::string_view kMagic("dofusion-journal-2\0", 19);
constexpr std::uint32_t kMark = 0xd0f51e57u;
constexpr std::size_t kFrame = 3 * sizeof(std::uint32_t);  // mark, length, checksum

template <class T>
void put(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

// Takes values off the front of bytes. Throws InputError when they run out.
class Parser {
 public:
  explicit Parser(std::string_view bytes) : rest_(bytes) {}

  template <class T>
  T take() {
    if (rest_.size() < sizeof(T)) throw InputError("an entry of the journal is too short");
    T value;
    std::memcpy(&value, rest_.data(), sizeof value);
    rest_.remove_prefix(sizeof value);
    return value;
  }
  bool at_end() const { return rest_.empty(); }

 private:
  std::string_view rest_;
};

std::uint32_t checksum(std::string_view bytes) {
  return static_cast<std::uint32_t>(::crc32_z(0, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

std::string header_of(const std::string& settings) {
  std::string header(kMagic);
  put(header, static_cast<std::uint64_t>(settings.size()));
  header += settings;
  put(header, checksum(settings));
  return header;
}

// A journal of whatever settings that holds nothing yet.
bool is_bare_header(std::string_view bytes) {
  if (bytes.substr(0, kMagic.size()) != kMagic) return false;
  const std::string_view rest = bytes.substr(kMagic.size());
  constexpr std::size_t kEnds = sizeof(std::uint64_t) + sizeof(std::uint32_t);  // length and checksum
  return rest.size() <= kEnds || rest.size() - kEnds <= Parser(rest).take<std::uint64_t>();
}

std::string framed(const std::string& payload) {
  std::string bytes;
  put(bytes, kMark);
  put(bytes, static_cast<std::uint32_t>(payload.size()));
  bytes += payload;
  put(bytes, checksum(payload));
  return bytes;
}

// The payload of the entry at the start of `bytes`, if there is a whole one.
std::optional<std::string_view> entry_at(std::string_view bytes) {
  if (bytes.size() < kFrame) return std::nullopt;
  Parser front(bytes);
  const auto mark = front.take<std::uint32_t>();
  const std::size_t length = front.take<std::uint32_t>();
  if (mark != kMark || length > bytes.size() - kFrame) return std::nullopt;
  const std::string_view payload = bytes.substr(2 * sizeof(std::uint32_t), length);
  Parser back(bytes.substr(2 * sizeof(std::uint32_t) + length));
  if (back.take<std::uint32_t>() != checksum(payload)) return std::nullopt;
  return payload;
}

// Calls visit(payload) for every whole entry; where one is damaged, goes on at the next mark that begins a whole one.
// Returns where the last whole entry ends.
template <class Visit>
std::size_t scan_entries(std::string_view bytes, std::size_t begin, const Visit& visit) {
  std::string mark;
  put(mark, kMark);
  std::size_t whole_until = begin;
  for (std::size_t at = begin; at < bytes.size();) {
    const auto payload = entry_at(bytes.substr(at));
    if (payload) {
      visit(*payload);
      at = whole_until = at + kFrame + payload->size();
    } else {
      at = std::min(bytes.find(mark, at + 1), bytes.size());
    }
  }
  return whole_until;
}

// A file's bytes, as memory; empty for an empty file.
class FileView {
 public:
  FileView(int file, const std::string& path) {
    struct stat status {};
    if (::fstat(file, &status) != 0) throw InputError(path + ": cannot be read (" + std::strerror(errno) + ")");
    size_ = static_cast<std::size_t>(status.st_size);
    if (size_ == 0) return;
    data_ = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file, 0);
    if (data_ == MAP_FAILED) throw InputError(path + ": cannot be read (" + std::strerror(errno) + ")");
  }
  ~FileView() {
    if (size_ > 0) ::munmap(data_, size_);
  }
  FileView(const FileView&) = delete;
  FileView& operator=(const FileView&) = delete;
  std::string_view bytes() const { return {static_cast<const char*>(data_), size_}; }

 private:
  void* data_ = nullptr;
  std::size_t size_ = 0;
};

bool still_has_its_name(int file, const std::string& path) {
  struct stat opened {
  }, named{};
  return ::fstat(file, &opened) == 0 && ::stat(path.c_str(), &named) == 0 && opened.st_ino == named.st_ino &&
         opened.st_dev == named.st_dev;
}

// Opens or makes the file and locks it against other runs. One that another run deletes meanwhile is not it.
int open_locked(const std::string& path) {
  while (true) {
    const int file = ::open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    if (file < 0) throw InputError(path + ": cannot be written (" + std::strerror(errno) + ")");
    if (::flock(file, LOCK_EX | LOCK_NB) != 0) {
      const int reason = errno;
      ::close(file);
      if (reason == EWOULDBLOCK) throw InputError(path + ": another run is at work on it");
      throw InputError(path + ": cannot be locked (" + std::strerror(reason) + ")");
    }
    if (still_has_its_name(file, path)) return file;
    ::close(file);
  }
}

}  // namespace

std::string encode_entry(const JournalEntry& entry) {
  std::string bytes;
  put(bytes, static_cast<std::int32_t>(entry.scene.part));
  put(bytes, entry.scene.index);
  put(bytes, entry.drops);
  put(bytes, entry.accepted);
  put(bytes, entry.restarts);
  put(bytes, static_cast<std::uint8_t>(entry.scene.task));
  for (const SceneObject& object : entry.scene.objects) {
    put(bytes, static_cast<std::int32_t>(object.shape));
    put(bytes, object.touches);
    for (int i = 0; i < 3; ++i) put(bytes, object.scale[i]);
    for (int i = 0; i < 12; ++i) put(bytes, object.T_world_object(i / 4, i % 4));
  }
  return bytes;
}

JournalEntry decode_entry(const std::string& payload) {
  Parser parser(payload);
  JournalEntry entry;
  entry.scene.part = parser.take<std::int32_t>();
  entry.scene.index = parser.take<std::int64_t>();
  entry.drops = parser.take<std::int64_t>();
  entry.accepted = parser.take<std::int64_t>();
  entry.restarts = parser.take<std::int64_t>();
  entry.scene.task = static_cast<Task>(parser.take<std::uint8_t>());
  while (!parser.at_end()) {
    SceneObject object;
    object.shape = parser.take<std::int32_t>();
    object.touches = parser.take<std::uint32_t>();
    for (int i = 0; i < 3; ++i) object.scale[i] = parser.take<double>();
    for (int i = 0; i < 12; ++i) object.T_world_object(i / 4, i % 4) = parser.take<double>();
    entry.scene.objects.push_back(object);
  }
  return entry;
}

SceneJournal::SceneJournal(const std::string& path, const std::string& settings)
    : path_(path), file_(open_locked(path)) {
  try {
    begin_or_check(settings);
    cut_torn_end();
  } catch (...) {
    ::close(file_);
    throw;
  }
}

SceneJournal::~SceneJournal() { ::close(file_); }

void SceneJournal::begin_or_check(const std::string& settings) {
  const std::string header = header_of(settings);
  header_size_ = header.size();
  const FileView view(file_, path_);
  const std::string_view bytes = view.bytes();
  if (bytes.substr(0, header.size()) == header) return;
  const std::string advice = "; delete it or choose another --out";
  // New, or killed while the header was written, or left before the first scene.
  if (std::string_view(header).substr(0, bytes.size()) == bytes || is_bare_header(bytes)) {
    if (::ftruncate(file_, 0) != 0 || !write_all(file_, header)) {
      throw InputError(path_ + ": cannot be written (" + std::strerror(errno) + ")");
    }
  } else if (bytes.substr(0, kMagic.size()) == kMagic) {
    throw InputError(path_ + ": left by a run with other settings" + advice);
  } else {
    throw InputError(path_ + ": not the journal of a run of this program" + advice);
  }
}

void SceneJournal::cut_torn_end() {
  std::size_t size = 0, whole_until = 0;
  {
    const FileView view(file_, path_);
    size = view.bytes().size();
    whole_until = scan_entries(view.bytes(), header_size_, [](std::string_view) {});
  }
  if (whole_until < size && ::ftruncate(file_, static_cast<off_t>(whole_until)) != 0) {
    throw InputError(path_ + ": cannot be written (" + std::strerror(errno) + ")");
  }
}

void SceneJournal::for_each(const std::function<void(const JournalEntry&)>& visit) const {
  const FileView view(file_, path_);
  scan_entries(view.bytes(), header_size_,
               [&](std::string_view payload) { visit(decode_entry(std::string(payload))); });
}

void SceneJournal::append(const std::string& payload) {
  const off_t end = ::lseek(file_, 0, SEEK_END);
  if (write_all(file_, framed(payload))) return;
  const int reason = errno;
  // The torn entry would be skipped anyway; a failure to cut it off changes nothing.
  if (end >= 0 && ::ftruncate(file_, end) != 0) errno = reason;
  throw InputError(path_ + ": cannot be written (" + std::strerror(reason) + "); the same command goes on from it");
}

void SceneJournal::remove() {
  if (::unlink(path_.c_str()) != 0) throw InputError(path_ + ": cannot be deleted (" + std::strerror(errno) + ")");
}

}  // namespace dofusion
