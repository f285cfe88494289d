#include "restart_seal.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <sys/stat.h>
#include <unistd.h>

using namespace LAMMPS_NS;

namespace {

// LAMMPS ends its restart files with a word that it looks for when it reads them.
constexpr std::size_t CLOSING_BYTES = 16;
constexpr char CLOSING_WORD[] = "LammpS RestartT";
// Where the notes begin, and the checksum of all that stands before this line.
constexpr char SEAL[] = "sealed by lammps-blast: %016" PRIx64 " %08" PRIx32 "\n";
constexpr char SEAL_TO_READ[] = "sealed by lammps-blast: %16" SCNx64 " %8" SCNx32;
constexpr std::size_t SEAL_BYTES = 24 + 16 + 1 + 8 + 1;
constexpr std::size_t BUFFER_BYTES = 1 << 20;

struct Closer {
  void operator()(FILE *file) const { fclose(file); }
};
using File = std::unique_ptr<FILE, Closer>;

std::runtime_error failure(const std::string &what)
{
  return std::runtime_error(what + ": " + strerror(errno));
}

// Anything else, a pipe say, might have its reader wait for ever.
File regular_file(const std::string &path)
{
  const int descriptor = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) throw failure("cannot be opened");
  File file(fdopen(descriptor, "rb"));
  struct stat status;
  if (!file || fstat(descriptor, &status) != 0) throw failure("cannot be opened");
  if (!S_ISREG(status.st_mode)) throw std::runtime_error("is no regular file");
  return file;
}

struct Seal {
  std::uint64_t begin_of_notes = 0, position = 0;
  std::uint32_t checksum = 0;
};

Seal seal_of(FILE *file)
{
  constexpr std::size_t count = SEAL_BYTES + CLOSING_BYTES;
  char text[count + 1] = {};
  fseek(file, 0, SEEK_END);
  const std::int64_t size = ftell(file);
  const auto position = size - static_cast<std::int64_t>(count);
  Seal seal;
  const char *closing = text + SEAL_BYTES;
  if (position < 0 || fseek(file, position, SEEK_SET) != 0 ||
      fread(text, 1, count, file) != count ||
      sscanf(text, SEAL_TO_READ, &seal.begin_of_notes, &seal.checksum) != 2 ||
      memcmp(closing, CLOSING_WORD, CLOSING_BYTES) != 0 ||
      seal.begin_of_notes > static_cast<std::uint64_t>(position))
    throw std::runtime_error("ends before its seal");
  seal.position = position;
  return seal;
}

std::uint32_t checksum_up_to(FILE *file, std::uint64_t end)
{
  std::vector<char> buffer(BUFFER_BYTES);
  std::uint32_t checksum = 0;
  fseek(file, 0, SEEK_SET);
  for (std::uint64_t done = 0; done < end;) {
    const std::size_t wanted = std::min<std::uint64_t>(BUFFER_BYTES, end - done);
    const std::size_t count = fread(buffer.data(), 1, wanted, file);
    if (count != wanted) throw failure("cannot be read to its end");
    checksum = crc32(buffer.data(), count, checksum);
    done += count;
  }
  return checksum;
}

RestartNotes notes_of(const std::string &path, bool all_of_it)
{
  const File file = regular_file(path);
  const Seal seal = seal_of(file.get());
  if (all_of_it && checksum_up_to(file.get(), seal.position) != seal.checksum)
    throw std::runtime_error("is damaged: its checksum is wrong");
  std::string text(seal.position - seal.begin_of_notes, ' ');
  fseek(file.get(), static_cast<std::int64_t>(seal.begin_of_notes), SEEK_SET);
  if (fread(&text[0], 1, text.size(), file.get()) != text.size())
    throw failure("cannot be read to its end");
  if (text.compare(0, 6, "\nstep ") != 0) throw std::runtime_error("has no notes where it says");
  return RestartNotes::of_text(text);
}

} // namespace

void RestartNotes::add(const std::string &keyword, const std::string &values)
{
  lines.emplace_back(keyword, values);
}

std::string RestartNotes::values(const std::string &keyword) const
{
  const auto found = all(keyword);
  return found.empty() ? "" : found.front();
}

std::vector<std::string> RestartNotes::all(const std::string &keyword) const
{
  std::vector<std::string> found;
  for (const auto &[word, values] : lines)
    if (word == keyword) found.push_back(values);
  return found;
}

std::int64_t RestartNotes::step() const
{
  return strtoll(values("step").c_str(), nullptr, 10);
}

std::string RestartNotes::text() const
{
  std::string text = "\n";
  for (const auto &[keyword, values] : lines) text += keyword + " " + values + "\n";
  return text;
}

RestartNotes RestartNotes::of_text(const std::string &text)
{
  RestartNotes notes;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    const auto space = line.find(' ');
    if (space != std::string::npos) notes.add(line.substr(0, space), line.substr(space + 1));
  }
  return notes;
}

std::uint32_t LAMMPS_NS::crc32(const char *bytes, std::size_t count, std::uint32_t of_those_before)
{
  // What eight steps of the shift register do to each byte, and eight bytes at once: the table of
  // byte k holds what becomes of a byte that k others follow.
  static const auto tables = [] {
    std::array<std::array<std::uint32_t, 256>, 8> made{};
    for (std::uint32_t byte = 0; byte < 256; byte++) {
      std::uint32_t rest = byte;
      for (int bit = 0; bit < 8; bit++) rest = (rest >> 1) ^ (rest & 1 ? 0xEDB88320u : 0u);
      made[0][byte] = rest;
    }
    for (int k = 1; k < 8; k++)
      for (int byte = 0; byte < 256; byte++)
        made[k][byte] = (made[k - 1][byte] >> 8) ^ made[0][made[k - 1][byte] & 0xFF];
    return made;
  }();
  const auto *next = reinterpret_cast<const unsigned char *>(bytes);
  std::uint32_t rest = ~of_those_before;
  for (; count >= 8; count -= 8, next += 8)
    rest = tables[7][(rest ^ next[0]) & 0xFF] ^ tables[6][((rest >> 8) ^ next[1]) & 0xFF] ^
           tables[5][((rest >> 16) ^ next[2]) & 0xFF] ^ tables[4][(rest >> 24) ^ next[3]] ^
           tables[3][next[4]] ^ tables[2][next[5]] ^ tables[1][next[6]] ^ tables[0][next[7]];
  for (; count > 0; count--, next++) rest = (rest >> 8) ^ tables[0][(rest ^ *next) & 0xFF];
  return ~rest;
}

void LAMMPS_NS::seal_restart_file(const std::string &path, const RestartNotes &notes)
{
  File file(fopen(path.c_str(), "r+b"));
  if (!file) throw failure("cannot be opened");
  char closing[CLOSING_BYTES] = {};
  fseek(file.get(), -static_cast<long>(CLOSING_BYTES), SEEK_END);
  if (fread(closing, 1, CLOSING_BYTES, file.get()) != CLOSING_BYTES ||
      memcmp(closing, CLOSING_WORD, CLOSING_BYTES) != 0)
    throw std::runtime_error("could not be written to its end: is there room on the disk?");
  const std::uint64_t begin_of_notes = ftell(file.get());
  const std::string text = notes.text();
  const std::uint32_t of_content = checksum_up_to(file.get(), begin_of_notes);
  const std::uint32_t checksum = crc32(text.data(), text.size(), of_content);
  fseek(file.get(), 0, SEEK_END);
  fwrite(text.data(), 1, text.size(), file.get());
  fprintf(file.get(), SEAL, begin_of_notes, checksum);
  fwrite(closing, 1, CLOSING_BYTES, file.get());
  if (fflush(file.get()) != 0 || ferror(file.get()) || fsync(fileno(file.get())) != 0)
    throw failure("could not be written to its end");
}

RestartNotes LAMMPS_NS::notes_of_restart_file(const std::string &path)
{
  return notes_of(path, false);
}

RestartNotes LAMMPS_NS::notes_of_whole_restart_file(const std::string &path)
{
  return notes_of(path, true);
}

void LAMMPS_NS::see_to_disk(const std::string &path)
{
  const int descriptor = open(path.c_str(), O_RDONLY);
  if (descriptor < 0) throw failure("cannot be opened");
  const bool is_done = fsync(descriptor) == 0;
  close(descriptor);
  // Some file systems cannot do it for folders.
  if (!is_done && errno != EINVAL) throw failure("could not be written to the disk");
}
