"""Words of the trade by which the strings of devices are judged; none of them is a maker's or a product's name.

Apart from the judgement itself (`naming`), because the lists only grow: each word in them was seen in strings that many
different products share.
"""

import re

# Words that say what kind of thing it is, or nothing at all; a string of only these names no model.
_GENERIC = """
    a an and the of for with in on to by at or no not none unknown default string manufacturer product name model my
    generic general standard composite multi multifunction function functional device devices gadget unit module board
    controller adapter adaptor converter bridge interface bus host root hub port ports ver version rev revision
    usb usb1 usb2 usb3 pci pcie express sata ata atapi ahci scsi nvme uas mmc sd tf i2c spi hid ps acpi pnp platform wmi
    full low high super speed hi-speed 2.0 3.0 integrated internal external built embedded onboard mobile portable
    hd fhd uhd qhd vga sd ir rgb camera cam webcam web video image imaging laptop notebook pc desktop mini nano slim pro
    audio sound speaker speakers soundbar microphone mic headset headphone headphones earphone earphones line codec dac
    adc amp amplifier midi mixer digital analog analogue output input in out stereo mono hifi uac uvc advanced enhanced
    keyboard keypad kb keys numeric mouse mice optical laser wired wireless receiver transceiver transmitter dongle
    stick gaming pointing scroll wheel combo set kit consumer control receive remote
    touch touchscreen touchpad screen pad pen stylus tablet pentablet panel display monitor finger gamepad joystick game
    gamecontroller mass storage disk drive flash memory reader writer card cards cardreader multi-card crw cd dvd rom
    ram removable media hdd ssd enclosure
    ethernet network lan wlan wifi wi fi gigabit fast bluetooth bt radio edr le rndis ecm ncm eem mbim qmi
    fingerprint biometric sensor sensors printer scanner printing print support serial uart com virtual vcp cdc acm
    modem power button buttons lid sleep switch system peripheral chipset family series series/ technology technologies
    inc ltd co corp corporation company limited gmbh llc ag sa srl electronics electronic semiconductor computer systems
    international communications r tm c vendor misc processor coprocessor chip soc microcontroller mcu nic udisk ic
    oscilloscope scope logic analyzer analyser ups gnss gps light lamp led leds dock docking token key security meter
    colorimeter thermometer relay kvm sdr tuner infrared fido u2f smartcard smart biometrics common universal dual
    single quad usbhid compliant compatible configurable code id raw data link cable type micro plug play easy new auto
    autofocus focus wide angle phone smartphone android linux mtp ptp adb mode fs hs ss boot bootloader dfu loader
    firmware fw application app dev devkit project recovery fastboot upgrade update download debug debugger
    probe jtag swd dap
    mechanical multimedia ergonomic backlit illuminated waterproof silent ultra premium compact smart professional
    extended slimline foldable rainbow multitouch digitizer digitiser grabber hdmi tv fm
    3d 1080 1000 2500 2000 3000 u
    broadband dvb dvbt atsc isdb dab hybrid capture capturing barcode bar qr scan imager lcd oled cooler fan weather
    station hygrometer barometer temperature humidity multimeter tester instrument spectrometer spectrum signal
    generator arbitrary waveform counter zigbee zwave wave coordinator gateway router wheel racing
    801 802 11 11a 11b 11g 11n 11ac 11ax 11an 11bgn cdma wcdma umts hspa hsdpa gsm lte msm fixed fd configuration
    this software sw has time limitation presenter pedal footswitch swipe magstripe magnetic stripe
"""
GENERIC = frozenset(_GENERIC.split())
# A version (v2) or a quantity with its unit (4mp, 32gb, 100m, 60fps): many products share them.
VERSION = re.compile(
    r"v\d+|\d+(?:[kgmp]|mpx?|mpix|megapixels?|[kmgt]bp?s?|bits?|fps|[kmg]?hz|ch|dpi|mah|ports?|inch|in)"
)
# What the wire is, not what hangs on it: a name with such words belongs to the chip.
TRANSPORT = re.compile(
    r"\bu(?:sb)?[\s_-]*\d?(?:\.\d)?[\s_-]*(?:<->|to|2)?[\s_-]*ser\b|serial|\buarts?\b|\bvcp\b|\bcom[\s_-]?port|"
    r"\brs[\s_-]?(?:232|422|485)|\b[a-z]{1,3}232[a-z]{0,2}\b|\bttl|\bvcom\b|\bfifo\b|"
    r"\bcdc[\s_-]acm\b|\bparallel port\b|\bieee[\s_-]?1284\b|\b(?:usb|hid)[\s\d._-]*to\b",
    re.IGNORECASE,
)
CONVERTER = re.compile(r"\busb[\s\d._-]*to\b", re.IGNORECASE)
# Words by which makers mark firmware that ships unchanged in other people's products, or the board it was written for.
REFERENCE = re.compile(
    r"demo|generic|sample|template|\bexamples?\b|reference design|\btest\b|evaluation|\beval\b|development kit|"
    r"\bdefault\b|\bprototype\b|\bgadget\b|\busb[\s_-]*device$|-(?:mtp|idp|qrd|cdp)\b",
    re.IGNORECASE,
)
# A state that many products have in common: what waits for new firmware does not say what it will be.
STATE = re.compile(
    r"boot[\s_-]?loader|\bpreloader\b|\bboot(?:[\s_-]|$)|\bdfu\b|\brecovery\b|fastboot|\bfirmware\b|\b(?:down|up)load\b|\bupgrade\b|"
    r"\b[fh]s mode\b",
    re.IGNORECASE,
)
CHIP = frozenset(("processor", "coprocessor", "chip", "chipset", "soc", "microcontroller"))
# Parts that sit inside a product; a string that speaks of one belongs to whoever made the part.
PART = CHIP | {"bridge", "codec", "transceiver", "fifo", "ic"}
# In the manufacturer's field these stand for nobody.
_PLACEHOLDER = """
    generic general default standard manufacturer vendor company co oem odm none no n a na unknown name brand noname
    string usb usb2 usb3 device devices hid test my your composite
"""
PLACEHOLDER = frozenset(_PLACEHOLDER.split())
# In the name of a maker: what it makes goes into other people's products.
CHIP_MAKER = frozenset(("semiconductor", "semiconductors", "microelectronics", "semi", "silicon", "chips", "chipset"))
# Kinds that exclude each other; a registered name that brings in another one speaks of another product.
KINDS = frozenset(
    ("bluetooth", "camera", "hub", "modem", "phone", "printer", "scanner", "serial", "storage", "webcam", "wifi")
)
