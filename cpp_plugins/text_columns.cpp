// Lines of numbers as an array of doubles; called from lammps_blast/text_columns.py.

#include <charconv>
#include <cstddef>
#include <system_error>

namespace {

bool is_blank(char c)
{
  return c == ' ' || c == '\t' || c == '\r';
}

const char *skip_blanks(const char *at, const char *end)
{
  while (at != end && is_blank(*at)) ++at;
  return at;
}

// Returns where the number ends, or nullptr. What from_chars alone would read but Python's float()
// would not is refused as well: "nan(...)", and numbers with a tail.
const char *read_number(const char *at, const char *end, double &value)
{
  if (at != end && *at == '+') { // a sign that from_chars does not know
    ++at;
    if (at != end && *at == '-') return nullptr;
  }
  const auto [stop, error] = std::from_chars(at, end, value);
  if (error != std::errc() || stop == end || stop[-1] == ')') return nullptr;
  return is_blank(*stop) || *stop == '\n' ? stop : nullptr;
}

// Returns where the next line begins, or nullptr if this one is not so many numbers and a line end.
const char *read_line(const char *at, const char *end, std::size_t columns, double *row)
{
  for (std::size_t column = 0; column < columns; ++column) {
    at = read_number(skip_blanks(at, end), end, row[column]);
    if (!at) return nullptr;
  }
  at = skip_blanks(at, end);
  return at != end && *at == '\n' ? at + 1 : nullptr;
}

} // namespace

// Reads the text from `begin` to `end` into `table`; true if it is just `rows` lines of `columns`
// numbers. If not, the caller's slower reader finds where, and whether that is an error.
extern "C" bool read_text_columns(const char *text, std::size_t begin, std::size_t end,
                                  std::size_t rows, std::size_t columns, double *table)
{
  const char *at = text + begin;
  for (std::size_t row = 0; row < rows && at; ++row)
    at = read_line(at, text + end, columns, table + row * columns);
  return at == text + end;
}
