#include "stability/hdf5_file.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

namespace dofusion {
namespace {

constexpr std::size_t kMemoryStep = 16u << 20;  // bytes by which a file in memory grows

void silence_errors() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

bool locked_by_a_writer(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool locked = file >= 0 && ::flock(file, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  if (file >= 0) ::close(file);
  return locked;
}

// Why a file that is there could not be opened.
std::string why_not(const std::string& path) {
  const std::string signature = "\x89HDF\r\n\x1a\n";
  std::string start(signature.size(), '\0');
  std::ifstream in(path, std::ios::binary);
  if (!in) return "cannot be read (" + std::string(std::strerror(errno)) + ")";
  if (locked_by_a_writer(path)) return "is open for writing elsewhere; try again when that is done";
  in.read(start.data(), static_cast<std::streamsize>(start.size()));
  if (!in || start != signature) return "not an HDF5 file";
  return "damaged or cut short";
}

hid_t open_for_reading(const std::string& path) {
  silence_errors();
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(path + ": no such dataset");
  return H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
}

hid_t create_in_memory() {
  silence_errors();
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "HDF5 does not start");
  H5Pset_fapl_core(access, kMemoryStep, false);
  static std::atomic<int> made{0};  // HDF5 tells files in memory apart by their names
  const std::string name = "dofusion-dataset-in-memory-" + std::to_string(made++);
  return H5Fcreate(name.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
}

hid_t string_type(std::size_t length) {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, length);
  H5Tset_cset(type, H5T_CSET_UTF8);
  return type;
}

// Fails only where there is no memory: the file is in it.
std::string cannot_make(const std::string& name) { return name + " cannot be made in memory"; }

void check(herr_t status, const std::string& name) {
  if (status < 0) throw InputError(cannot_make(name));
}

}  // namespace

Hdf5Reader::Hdf5Reader(const std::string& path)
    : path_(path),
      file_(
          [&] {
            const hid_t file = open_for_reading(path);
            if (file < 0) throw InputError(path + ": " + why_not(path));
            return file;
          }(),
          H5Fclose, path) {}

void Hdf5Reader::fail(const std::string& what) const { throw InputError(path_ + ": " + what); }

// A damaged file may claim any size, and memory is taken before it is read.
void Hdf5Reader::check_size(const std::string& name, hid_t data, hsize_t count, hsize_t value_size) const {
  hsize_t file_size = 0;
  H5Fget_filesize(file_, &file_size);
  const Hdf5Handle properties(H5Dget_create_plist(data), H5Pclose, path_ + ": " + name + " cannot be read");
  const hsize_t most_compressed = H5Pget_layout(properties) == H5D_CHUNKED ? 1032 : 1;  // deflate's limit
  if (value_size > 0 && count > most_compressed * file_size / value_size) {
    fail(name + " claims to be larger than the file; it is damaged");
  }
}

std::size_t Hdf5Reader::open_table(const std::string& name, std::size_t columns, std::size_t value_size) const {
  const Hdf5Handle data(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose, path_ + ": " + name + " is missing");
  const Hdf5Handle space(H5Dget_space(data), H5Sclose, path_ + ": " + name + " cannot be read");
  hsize_t size[2] = {0, 1};
  const int rank = H5Sget_simple_extent_ndims(space), wanted = columns == 1 ? 1 : 2;
  if (rank == wanted) H5Sget_simple_extent_dims(space, size, nullptr);
  if (rank != wanted || size[1] != columns) {
    fail(name + " has the wrong shape; expected " + std::to_string(columns) + " columns");
  }
  const Hdf5Handle type(H5Dget_type(data), H5Tclose, path_ + ": " + name + " cannot be read");
  check_size(name, data, size[0], columns * std::min(value_size, H5Tget_size(type)));
  return static_cast<std::size_t>(size[0]);
}

void Hdf5Reader::read_table(const std::string& name, hid_t type, void* values) const {
  const Hdf5Handle data(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose, path_ + ": " + name + " is missing");
  if (H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) {
    fail(name + " cannot be read; is it numeric and the file whole?");
  }
}

std::vector<std::string> Hdf5Reader::strings(const std::string& name) const {
  const std::string unreadable = path_ + ": " + name + " cannot be read";
  const Hdf5Handle data(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose, path_ + ": " + name + " is missing");
  const Hdf5Handle type(H5Dget_type(data), H5Tclose, unreadable);
  const Hdf5Handle space(H5Dget_space(data), H5Sclose, unreadable);
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) > 0) {
    fail(name + " should hold strings of fixed length");
  }
  const std::size_t length = H5Tget_size(type);
  const auto count = static_cast<std::size_t>(std::max<hssize_t>(H5Sget_simple_extent_npoints(space), 0));
  check_size(name, data, count, length);
  std::string bytes(length * count, '\0');
  if (H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) < 0) throw InputError(unreadable);
  std::vector<std::string> result;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string text = bytes.substr(i * length, length);
    result.push_back(text.substr(0, text.find('\0')));
  }
  return result;
}

std::string Hdf5Reader::text_attribute(const std::string& name) const {
  const std::string what = "attribute '" + name + "' ";
  const Hdf5Handle attribute(H5Aopen(file_, name.c_str(), H5P_DEFAULT), H5Aclose,
                             path_ + ": " + what + "is missing; is this a dataset of scenes?");
  const Hdf5Handle type(H5Aget_type(attribute), H5Tclose, path_ + ": " + what + "cannot be read");
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) > 0) {
    fail(what + "should be a string of fixed length");
  }
  std::string text(H5Tget_size(type), '\0');
  if (H5Aread(attribute, type, text.data()) < 0) fail(what + "cannot be read");
  return text.substr(0, text.find('\0'));
}

std::int64_t Hdf5Reader::integer_attribute(const std::string& name) const {
  const std::string what = "attribute '" + name + "' ";
  const Hdf5Handle attribute(H5Aopen(file_, name.c_str(), H5P_DEFAULT), H5Aclose,
                             path_ + ": " + what + "is missing; is this a dataset of scenes?");
  const Hdf5Handle space(H5Aget_space(attribute), H5Sclose, path_ + ": " + what + "cannot be read");
  std::int64_t value = 0;
  if (H5Sget_simple_extent_npoints(space) != 1 || H5Aread(attribute, H5T_NATIVE_INT64, &value) < 0) {
    fail(what + "should be a whole number");
  }
  return value;
}

Hdf5Writer::Hdf5Writer() : file_(create_in_memory(), H5Fclose, cannot_make("an HDF5 file")) {}

void Hdf5Writer::group(const std::string& name) {
  const Hdf5Handle properties(H5Pcreate(H5P_GROUP_CREATE), H5Pclose, cannot_make(name));
  H5Pset_obj_track_times(properties, false);
  const Hdf5Handle made(H5Gcreate2(file_, name.c_str(), H5P_DEFAULT, properties, H5P_DEFAULT), H5Gclose,
                        cannot_make(name));
}

void Hdf5Writer::write_table(const std::string& name, hid_t type, const void* values, std::size_t rows,
                             std::size_t columns) {
  const hsize_t size[2] = {rows, columns};
  const Hdf5Handle space(H5Screate_simple(columns == 1 ? 1 : 2, size, nullptr), H5Sclose, cannot_make(name));
  write(name, type, space, values);
}

void Hdf5Writer::strings(const std::string& name, const std::vector<std::string>& values) {
  std::size_t length = 1;
  for (const std::string& value : values) length = std::max(length, value.size() + 1);
  const Hdf5Handle type(string_type(length), H5Tclose, cannot_make(name));
  std::string bytes;
  for (std::string value : values) {
    value.resize(length, '\0');
    bytes += value;
  }
  const hsize_t size = values.size();
  const Hdf5Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose, cannot_make(name));
  write(name, type, space, bytes.data());
}

void Hdf5Writer::text_attribute(const std::string& name, const std::string& text) {
  const Hdf5Handle type(string_type(text.size() + 1), H5Tclose, cannot_make(name));
  const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose, cannot_make(name));
  const Hdf5Handle attribute(H5Acreate2(file_, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
                             cannot_make(name));
  check(H5Awrite(attribute, type, text.c_str()), name);
}

void Hdf5Writer::integer_attribute(const std::string& name, std::int64_t value) {
  const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose, cannot_make(name));
  const Hdf5Handle attribute(H5Acreate2(file_, name.c_str(), H5T_STD_I64LE, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
                             cannot_make(name));
  check(H5Awrite(attribute, H5T_NATIVE_INT64, &value), name);
}

void Hdf5Writer::write(const std::string& name, hid_t type, hid_t space, const void* values) {
  const Hdf5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, cannot_make(name));
  H5Pset_obj_track_times(properties, false);
  const Hdf5Handle data(H5Dcreate2(file_, name.c_str(), type, space, H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose,
                        cannot_make(name));
  check(H5Dwrite(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), name);
}

std::string Hdf5Writer::bytes() {
  check(H5Fflush(file_, H5F_SCOPE_GLOBAL), "the file");
  const ssize_t size = H5Fget_file_image(file_, nullptr, 0);
  std::string image(static_cast<std::size_t>(std::max<ssize_t>(size, 0)), '\0');
  if (size <= 0 || H5Fget_file_image(file_, image.data(), image.size()) != size) {
    throw InputError(cannot_make("the file"));
  }
  return image;
}

}  // namespace dofusion
