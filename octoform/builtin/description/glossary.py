"""Words of the trade in other languages: what the string of a device reports in English.

A device sold in one country speaks its language. The stems here are general words for kinds of devices (printer, scale,
dosimeter), none of them a maker's or a product's; the longest that is in a string counts. Chinese, Japanese and
Korean do not part words, so a stem is looked for anywhere; in other languages only at the beginning of a word.
"""

import re
import unicodedata

from octoform.patterns import regex

_STEMS: dict[str, str] = {
    "thermal printer": "热敏打印机 熱感應印表機 サーマルプリンタ термопринтер thermodrucker",
    "label printer": "标签打印机 標籤印表機 ラベルプリンタ принтер_этикеток etikettendrucker",
    "printer": "打印机 印表機 プリンタ 프린터 принтер εκτυπωτ طابعة מדפסת drucker imprimante impresora stampante",
    "image scanner": "イメージスキャナ",
    "document scanner": "扫描仪 掃描器 スキャナ 스캐너 сканер σαρωτ ماسح dokumentenscanner numériseur escáner",
    "barcode scanner": "条码扫描 條碼掃描 条形码 バーコード 바코드 сканер_штрих штрихкод barcodeleser lecteur_de_code",
    "web camera": "网络摄像头 ウェブカメラ webカメラ 웹캠 веб-камер вебкамер",
    "camera": "摄像头 攝影機 相机 照相机 カメラ 카메라 камера κάμερα كاميرا מצלמה kamera caméra cámara fotocamera",
    "microscope": "显微镜 顕微鏡 현미경 микроскоп μικροσκόπ mikroskop",
    "mechanical keyboard": "机械键盘 機械鍵盤 механическая_клавиатура",
    "keyboard": "键盘 鍵盤 キーボード 키보드 клавиатур πληκτρολόγ مفاتيح מקלדת tastatur clavier teclado tastiera",
    "mouse": "鼠标 滑鼠 マウス 마우스 мышь ποντίκι فأرة עכבר souris ratón",
    "gamepad": "游戏手柄 手柄 ゲームパッド ジョイスティック 게임패드 геймпад джойстик",
    "touch screen": "触摸屏 觸控 タッチパネル 터치스크린 сенсорный_экран οθόνη_αφής",
    "pen tablet": "手写板 数位板 ペンタブレット 태블릿 графический_планшет grafiktablett",
    "headset": "耳机 耳機 ヘッドセット ヘッドホン 헤드셋 наушник гарнитур ακουστικ kopfhörer casque auricular",
    "microphone": "麦克风 麥克風 マイク 마이크 микрофон μικρόφων ميكروفون מיקרופון mikrofon micrófono microfono",
    "speaker": "音箱 扬声器 喇叭 スピーカ 스피커 колонк динамик ηχείο lautsprecher haut-parleur altavoz",
    "sound card": "声卡 音效卡 サウンドカード オーディオ 사운드 звуковая soundkarte carte_son",
    "electronic scale": "电子秤 весы_электронн электронные_весы",
    "scale": "电子天平 体重计 はかり 저울 весы ζυγαρι ميزان waage báscula bilancia",
    "temperature humidity logger": "温湿度记录 溫濕度記錄 温湿度ロガー",
    "temperature humidity sensor": "温湿度 溫濕度 온습도",
    "thermometer": "温度计 溫度計 温度計 온도계 термометр θερμόμετρ حرارة מדחום thermomètre termómetro termometro",
    "temperature": "温度 温感 온도 температур θερμοκρασ temperatur",
    "humidity": "湿度 濕度 습도 влажност υγρασ feuchte humidité humedad",
    "pressure": "压力 壓力 気圧 압력 давлен πίεσ luftdruck",
    "radiation dosimeter": "辐射 輻射 线量計 線量計 방사선 дозиметр δοσίμετρ dosimètre",
    "radiation geiger counter": "盖革 ガイガー радиометр счётчик_гейгера",
    "co2 air quality": "二氧化碳 空气质量 二酸化炭素 углекисл",
    "gas sensor": "气体 ガスセンサ газоанализатор",
    "oscilloscope": "示波器 オシロスコープ 오실로스코프 осциллограф παλμογράφ oszilloskop osciloscopio",
    "logic analyser": "逻辑分析 ロジックアナライザ логический_анализатор",
    "multimeter": "万用表 萬用表 マルチメータ テスター 멀티미터 мультиметр πολύμετρ multimètre multímetro",
    "power supply": "稳压电源 直流電源 блок_питания labornetzteil",
    "uninterruptible power supply ups": "不间断电源 不斷電 無停電電源 무정전 бесперебойн αδιάλειπτ onduleur",
    "fingerprint reader": "指纹 指紋 지문 отпечат δακτυλικ بصمة fingerabdruck empreinte huella",
    "id card reader": "身份证 身分證",
    "card reader": "读卡器 讀卡機 カードリーダ 카드리더 считывател картридер αναγνώστ kartenleser lecteur_de_carte",
    "nfc reader": "射频 パソリ",
    "smart card reader": "智能卡 晶片卡 スマートカード смарт-карт chipkarte carte_à_puce",
    "flash drive": "优盘 闪存盘 闪存 隨身碟 フラッシュメモリ флэш-накоп флешк usb-stick",
    "hard disk": "硬盘 硬碟 ハードディスク жёсткий_диск festplatte disque_dur",
    "phone": "手机 手機 携帯電話 スマートフォン 갤럭시 휴대폰 телефон смартфон τηλέφων هاتف",
    "bluetooth": "蓝牙 藍牙 ブルートゥース 블루투스 блютуз",
    "wireless network": "无线网卡 無線網卡 無線lan 무선랜 беспроводн",
    "network adapter": "网卡 網卡 ネットワーク сетевая_карт netzwerkkarte",
    "video capture": "采集卡 擷取卡 キャプチャ 캡처 видеозахват",
    "hub": "集线器 集線器 ハブ 허브 концентратор",
    "light": "灯 ライト 照明 조명 лампа светильник λάμπα leuchte lampe",
    "relay": "继电器 繼電器 リレー 릴레이 реле ρελέ relais relé",
    "motor": "电机 電機 モータ 모터 двигател",
    "robot": "机器人 機器人 ロボット 로봇 робот ρομπότ",
    "satellite positioning gps": "卫星 衛星 導航 навигац глонасс δορυφόρ",
    "radio": "对讲机 電台 ラジオ 無線機 무전기 радиостанц ραδιόφων funkgerät",
    "serial": "串口 串行 シリアル 직렬 последовательн σειριακ",
    "converter": "转换器 轉換器 変換 변환 преобразовател μετατροπ wandler convertisseur",
    "electroencephalograph eeg": "脑电 脳波 энцефалограф",
    "blood pressure": "血压 血圧 혈압 тонометр blutdruck",
    "oximeter": "血氧 パルスオキシメータ пульсоксиметр",
    "sensor": "传感器 感測器 センサ 센서 датчик αισθητήρ حساس sensore capteur",
    "meter": "测量 測定 측정 измерител μετρητ messgerät",
}
_SHORT = 5
_JOINED = regex(r"[\u3040-\u30ff\u3400-\u9fff\uac00-\ud7af]")


def english(text: str) -> str:
    """The English words for what a string states in another language; "" where it states nothing known here."""
    plain = unicodedata.normalize("NFKC", text).casefold()
    found = sorted(
        ((-len(stem), at, meaning) for stem, meaning in _MEANINGS if (at := _place(stem, plain)) >= 0),
        key=lambda each: each[:2],
    )
    taken: list[tuple[int, int, str]] = []
    for length, at, meaning in found:
        if all(at >= end or at - length <= begin for begin, end, _ in taken):
            taken.append((at, at - length, meaning))
    words = " ".join(meaning for _, _, meaning in sorted(taken)).split()
    return " ".join(dict.fromkeys(words))


def _place(stem: str, text: str) -> int:
    """Where a stem is in a string, -1 where it does not."""
    if _JOINED.search(stem):
        return text.find(stem)
    end = r"(?!\w)" if len(stem) < _SHORT else ""
    found = re.search(rf"(?<!\w){re.escape(stem)}{end}", text)
    return found.start() if found else -1


def _meanings() -> list[tuple[str, str]]:
    return [
        (unicodedata.normalize("NFKC", stem).replace("_", " ").casefold(), meaning)
        for meaning, stems in _STEMS.items()
        for stem in stems.split()
    ]


_MEANINGS = _meanings()
