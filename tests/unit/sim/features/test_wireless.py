"""What the simulated drone's Wi-Fi says, in both of Parrot's languages."""

from __future__ import annotations

import pytest
from support.sim_bench import Bench

from anafi_mav.arsdk.messages import wifi
from anafi_mav.arsdk.messages.proto import connectivity


def test_scan_lists_neighbours_of_the_requested_bands() -> None:
    bench = Bench()
    both = bench.send(wifi.Scan(0b11))
    assert [item.list_flags for item in both if isinstance(item, wifi.ScannedItem)] == [1, 2]
    (one,) = bench.send(wifi.Scan(1 << wifi.Band._5_GHZ))
    assert isinstance(one, wifi.ScannedItem)
    assert (one.band, one.list_flags) == (wifi.Band._5_GHZ, 3)
    (nothing,) = bench.send(wifi.Scan(0))
    assert isinstance(nothing, wifi.ScannedItem)
    assert nothing.list_flags == 4


def test_authorized_channels_of_both_bands_are_listed() -> None:
    channels = Bench().send(wifi.UpdateAuthorizedChannels())
    found = {(item.band, item.channel) for item in channels if isinstance(item, wifi.AuthorizedChannel)}
    assert (wifi.Band._2_4_GHZ, 6) in found
    assert (wifi.Band._5_GHZ, 44) in found
    assert (wifi.Band._5_GHZ, 37) not in found


def radio(answer: object) -> connectivity.State:
    assert isinstance(answer, connectivity.State)
    return answer


def test_ai_reports_its_radio() -> None:
    bench = Bench("ai")
    (listed,) = bench.send(connectivity.ListRadios())
    assert listed == connectivity.RadioList(radios={0: connectivity.RadioType.WIFI})
    assert bench.send(connectivity.ListRadios(type_filter=(connectivity.RadioType.MARS,))) == [
        connectivity.RadioList(radios={})
    ]
    assert bench.send(connectivity.GetState(radio_id=7)) == []
    (answer,) = bench.send(connectivity.GetState(include_default_capabilities=True))
    state = radio(answer)
    assert state.default_capabilities is not None
    assert state.authorized_channels is not None
    frequencies = {one.frequency for one in state.authorized_channels.channel}
    assert {2437, 5180} <= frequencies  # channels 6 and 36
    (answer,) = bench.send(connectivity.GetState(supports_packed_channels=True))
    packed = radio(answer).authorized_packed_channels
    assert packed is not None
    assert [(one.first_id, one.number_of_channels, one.first_frequency) for one in packed.channels] == [
        (1, 11, 2412),
        (36, 4, 5180),
    ]
    (scan,) = bench.send(connectivity.Scan())
    assert isinstance(scan, connectivity.ScanResult)
    assert len(scan.networks) == 2


@pytest.mark.parametrize(
    ("band", "id", "taken"), [(connectivity.Band._2_4_GHZ, 11, 11), (connectivity.Band._5_0_GHZ, 37, 36)]
)
def test_the_ais_radio_is_configured(band: connectivity.Band, id: int, taken: int) -> None:
    bench = Bench("ai")
    channel = connectivity.Channel(radio_channel=connectivity.RadioChannel(band=band, id=id))
    wanted = connectivity.AccessPointConfig(ssid="mine", country="XX", manual_channel=channel)
    (answer,) = bench.send(connectivity.Configure(access_point_config=wanted))
    config = radio(answer).access_point_config
    assert config is not None
    assert (config.ssid, config.country) == ("mine", "FR")  # there is no such country
    assert config.manual_channel is not None
    assert config.manual_channel.radio_channel is not None
    assert config.manual_channel.radio_channel.id == taken
