#pragma once

#include <cstddef>
#include <memory>

#include "core/error.h"

namespace gridcast::server {

/// Keeps a server off the cores of its clients, who otherwise live on other machines. While it lives, every
/// thread of this process, and those that they start, has the first cores alone; a client's thread moves to
/// the one behind them. One at a time.
class CoresApart {
 public:
  /// `server_cores` for the server, and one more. kUnsupported when the process may not use so many.
  [[nodiscard]] static Result<std::unique_ptr<CoresApart>> make(std::size_t server_cores);
  /// Gives all threads the cores that there were.
  ~CoresApart();
  CoresApart(const CoresApart&) = delete;
  CoresApart& operator=(const CoresApart&) = delete;

  /// The calling thread is a client's from now on, or the server's again.
  void be_client() const;
  void be_server() const;

 private:
  struct Sets;
  explicit CoresApart(std::unique_ptr<Sets> sets);

  std::unique_ptr<Sets> sets_;
};

}  // namespace gridcast::server
