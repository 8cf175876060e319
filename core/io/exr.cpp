#include <algorithm>
#include <cstring>
#include <exception>
#include <optional>
#include <set>
#include <string>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfOutputFile.h>

#include "core/io/image.h"
#include "core/io/layer_check.h"

namespace gridcast::io {
namespace {

/// A growing block of memory that OpenEXR writes to; it seeks back to fill in its table of offsets.
class MemoryStream final : public Imf::OStream {
 public:
  MemoryStream() : OStream("memory") {}
  void write(const char data[], int count) override {
    const std::size_t end = position_ + std::size_t(count);
    if (end > bytes_.size()) bytes_.resize(end);
    std::memcpy(bytes_.data() + position_, data, std::size_t(count));
    position_ = end;
  }
  std::uint64_t tellp() override { return position_; }
  void seekp(std::uint64_t position) override { position_ = std::size_t(position); }
  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
  std::size_t position_ = 0;
};

std::string channel_name(const render::Layer& layer, std::size_t channel) {
  const std::string& name = layer.channels[channel];
  return layer.name == "color" ? name : layer.name + "." + name;
}

/// OpenEXR's frame buffer wants pointers to change; when writing it only reads through them.
template <class T>
char* as_chars(const T* data) {
  return const_cast<char*>(reinterpret_cast<const char*>(data));
}

void add_layer(const render::Film& film, const render::Layer& layer, Imf::Header& header,
               Imf::FrameBuffer& frame) {
  const bool is_id = !layer.ids.empty();
  const Imf::PixelType type = is_id ? Imf::UINT : Imf::FLOAT;
  const std::size_t stride = 4 * layer.channels.size();
  for (std::size_t c = 0; c < layer.channels.size(); ++c) {
    const std::string name = channel_name(layer, c);
    char* first = is_id ? as_chars(layer.ids.data()) : as_chars(layer.values.data() + c);
    header.channels().insert(name, Imf::Channel(type));
    frame.insert(name, Imf::Slice(type, first, stride, stride * std::size_t(film.width_px)));
  }
}

/// Between two looks at the stop token: a few blocks of compression, some ten milliseconds.
constexpr int kRowsAtOnce = 32;

/// Nothing when stopped.
std::optional<std::vector<std::byte>> write_to_memory(const render::Film& film, const std::stop_token& stop) {
  Imf::Header header(film.width_px, film.height_px);
  header.compression() = Imf::ZIP_COMPRESSION;
  header.insert("gridcast:exposure", Imf::FloatAttribute(film.exposure));
  Imf::FrameBuffer frame;
  for (const render::Layer& layer : film.layers) add_layer(film, layer, header, frame);

  MemoryStream stream;
  {
    // No threads of its own: the caller's pool decides how many cores a request takes.
    Imf::OutputFile file(stream, header, 0);
    file.setFrameBuffer(frame);
    for (int row = 0; row < film.height_px; row += kRowsAtOnce) {
      if (stop.stop_requested()) return std::nullopt;
      file.writePixels(std::min(kRowsAtOnce, film.height_px - row));
    }
  }
  return stream.take();
}

}  // namespace

Result<std::vector<std::byte>> encode_exr(const render::Film& film, const std::stop_token& stop) {
  static_assert(sizeof(unsigned) == 4 && sizeof(float) == 4);
  if (film.layers.empty()) return Error{ErrorCode::kInvalidArgument, "the picture has no layer", ""};
  std::set<std::string> names;
  for (const render::Layer& layer : film.layers) {
    if (Status status = check_layer(film, layer); !status) return status.error();
    if (names.insert(layer.name).second) continue;
    return Error{ErrorCode::kInvalidArgument, "the picture has two layers named '" + layer.name + "'", ""};
  }
  try {
    if (auto bytes = write_to_memory(film, stop)) return *std::move(bytes);
    return Error{ErrorCode::kCancelled, "the picture was cancelled", ""};
  } catch (const std::exception& e) {
    return Error{ErrorCode::kInternal, std::string("OpenEXR: ") + e.what(), ""};
  }
}

}  // namespace gridcast::io
