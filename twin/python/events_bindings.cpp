// SPDX-License-Identifier: Apache-2.0
// The events in the bytes of an LCM log (LCM 1.5, lcm/eventlog.c).
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "arrays.h"

using namespace nanobind::literals;

namespace twin
{
namespace
{

constexpr std::string_view kSync = "\xed\xa1\xda\x01";
constexpr size_t kHeader = 28;       // sync word, number and stamp of 8 bytes, two lengths of 4
constexpr int64_t kMaxChannel = 63;  // LCM_MAX_CHANNEL_NAME_LENGTH

struct Event
{
    int64_t stamp_us;
    size_t start, end;  // of the payload; the channel's name lies before it
};

struct Channel
{
    std::string name;
    std::vector<int64_t> stamps_us, ends;  // ends of the payloads, one behind the other
    std::vector<size_t> starts;            // of the payloads in the log

    void Add(const Event &event)
    {
        stamps_us.push_back(event.stamp_us);
        ends.push_back((ends.empty() ? 0 : ends.back()) +
                       static_cast<int64_t>(event.end - event.start));
        starts.push_back(event.start);
    }
    // All payloads: objects of their own would take twice the room.
    nb::bytes Joined(std::string_view data) const
    {
        auto joined = nb::steal<nb::bytes>(PyBytes_FromStringAndSize(nullptr, ends.back()));
        char *to = PyBytes_AsString(joined.ptr());
        for (size_t i = 0; i < starts.size(); ++i)
        {
            const auto begin = static_cast<size_t>(i == 0 ? 0 : ends[i - 1]);
            std::memcpy(to + begin, data.data() + starts[i], static_cast<size_t>(ends[i]) - begin);
        }
        return joined;
    }
};

int64_t BigEndian(std::string_view bytes)
{
    uint64_t value =
        static_cast<unsigned char>(bytes[0]) & 0x80 && bytes.size() < 8 ? UINT64_MAX : 0;
    for (const char byte : bytes)
        value = value << 8 | static_cast<unsigned char>(byte);
    return static_cast<int64_t>(value);
}

// The event at `position`; nothing if no complete one is there.
std::optional<Event> EventAt(std::string_view data, size_t position)
{
    if (position + kHeader > data.size() || data.substr(position, kSync.size()) != kSync)
        return {};
    const auto number = [&](size_t at, size_t size) {
        return BigEndian(data.substr(position + at, size));
    };
    const int64_t channel_size = number(20, 4), data_size = number(24, 4);
    if (channel_size <= 0 || channel_size > kMaxChannel || data_size < 0)
        return {};
    const size_t start = position + kHeader + static_cast<size_t>(channel_size);
    if (start + static_cast<size_t>(data_size) > data.size())
        return {};
    return Event{number(12, 8), start, start + static_cast<size_t>(data_size)};
}

// Channels in the order in which they appear, and what is no event: from where to where, -1 if to
// the end, and whether an event came before.
nb::tuple EventsOf(nb::bytes log)
{
    const std::string_view data(log.c_str(), log.size());
    std::map<std::string_view, size_t> known;
    std::vector<Channel> channels;
    nb::list gaps;
    for (size_t position = 0; position < data.size();)
    {
        const std::optional<Event> event = EventAt(data, position);
        if (!event)
        {
            const size_t next = data.find(kSync, position + 1);
            const bool last = next == std::string_view::npos;
            gaps.append(nb::make_tuple(position, last ? -1 : static_cast<int64_t>(next),
                                       !channels.empty()));
            if (last)
                break;
            position = next;
            continue;
        }
        const std::string_view name =
            data.substr(position + kHeader, event->start - position - kHeader);
        const auto [at, is_new] = known.try_emplace(name, channels.size());
        if (is_new)
            channels.push_back(
                {.name = std::string(name), .stamps_us = {}, .ends = {}, .starts = {}});
        channels[at->second].Add(*event);
        position = event->end;
    }
    nb::list found;
    for (Channel &channel : channels)
    {
        const size_t count = channel.starts.size();
        const nb::bytes joined = channel.Joined(data);
        found.append(nb::make_tuple(nb::bytes(channel.name.data(), channel.name.size()),
                                    ToNumpy(std::move(channel.stamps_us), {count}), joined,
                                    ToNumpy(std::move(channel.ends), {count})));
    }
    return nb::make_tuple(found, gaps);
}

}  // namespace

void BindEvents(nb::module_ &m)
{
    m.def("events_of", &EventsOf, "log"_a,
          "Of the bytes of an LCM log: channels in the order in which they appear, each as its "
          "name, stamps in us, payloads one behind the other and where each ends; and (from, to, "
          "whether an event came before) of what is no event, to -1 if it goes on to the end.");
}

}  // namespace twin
