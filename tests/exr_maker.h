#pragma once
// Writes OpenEXR files for tests, with the library itself.
#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfChromaticitiesAttribute.h>
#include <ImfEnvmap.h>
#include <ImfEnvmapAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <ImfStandardAttributes.h>
#include <ImfTiledOutputFile.h>

#include <cstring>
#include <functional>
#include <string>
#include <vector>

namespace lambent::test {

using Bytes = std::vector<uint8_t>;

// Bytes that OpenEXR writes.
struct Output : Imf::OStream {
  Bytes bytes;
  size_t at = 0;
  Output() : OStream("test") {}
  void write(const char data[], int count) override {
    bytes.resize(std::max(bytes.size(), at + size_t(count)));
    std::memcpy(bytes.data() + at, data, size_t(count));
    at += size_t(count);
  }
  uint64_t tellp() override { return at; }
  void seekp(uint64_t position) override { at = position; }
};

// An OpenEXR file with any header and channels; value(channel, x, y) counts from the data window's corner.
struct Maker {
  Imf::Header header;
  std::vector<std::pair<std::string, Imf::Channel>> channels;
  std::function<float(size_t channel, int x, int y)> value;
  bool tiled = false;

  Maker(int width, int height, std::initializer_list<const char*> names, Imf::PixelType type = Imf::FLOAT)
      : header(width, height) {
    for (const char* name : names) channels.emplace_back(name, Imf::Channel(type));
    value = [](size_t c, int x, int y) { return 0.25f * float(c) + float(x) + 16 * float(y); };
  }
  Bytes bytes() {
    Imath::Box2i window = header.dataWindow();
    int width = window.max.x - window.min.x + 1, height = window.max.y - window.min.y + 1;
    std::vector<std::vector<char>> planes;
    Imf::FrameBuffer slices;
    for (size_t c = 0; c < channels.size(); ++c) {
      auto& [name, channel] = channels[c];
      header.channels().insert(name, channel);
      size_t size = channel.type == Imf::HALF ? 2 : 4, columns = size_t(width / channel.xSampling);
      std::vector<char>& plane = planes.emplace_back(size * size_t(width) * size_t(height));
      for (int y = 0; y < height / channel.ySampling; ++y)
        for (int x = 0; x < width / channel.xSampling; ++x) {
          char* p = plane.data() + (size_t(y) * columns + size_t(x)) * size;
          float v = value(c, x, y);
          half h(v);
          uint32_t u = channel.type == Imf::UINT ? uint32_t(v) : 0;
          std::memcpy(p,
                      channel.type == Imf::HALF   ? static_cast<void*>(&h)
                      : channel.type == Imf::UINT ? static_cast<void*>(&u)
                                                  : &v,
                      size);
        }
    }
    for (size_t c = 0; c < channels.size(); ++c) {
      const Imf::Channel& channel = channels[c].second;
      size_t size = channel.type == Imf::HALF ? 2 : 4, columns = size_t(width / channel.xSampling);
      slices.insert(channels[c].first, Imf::Slice::Make(channel.type, planes[c].data(), window, size, size * columns,
                                                        channel.xSampling, channel.ySampling));
    }
    Output out;
    if (tiled) {
      header.setTileDescription(Imf::TileDescription(4, 3, Imf::ONE_LEVEL));
      Imf::TiledOutputFile file(out, header, 0);
      file.setFrameBuffer(slices);
      file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
    } else {
      Imf::OutputFile file(out, header, 0);
      file.setFrameBuffer(slices);
      file.writePixels(height);
    }
    return std::move(out.bytes);
  }
};

}  // namespace lambent::test
